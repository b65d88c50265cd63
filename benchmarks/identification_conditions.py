"""Do the intervals of `stickslip identify` cover where a machine rests, or a force is late?

- `axis RATE DWELL`: an axis of 38 kg under position control with that share of rest, an encoder of
  2 um and noise of 0.5 N; the law is `coulomb`.
- `uneven`: steps of 10 or 12 ms, force and position read at once, on an axis of 4 kg.
- `coast LAW`: an axis of 40 kg, given, coasts to rest three times, with no force; its motion is
  integrated by SciPy, the encoder has 1 um and noise of 2 um.
- `late DELAY LAG`, ms: the run `taps` of the drive of `benchmarks.identification`, whose force is
  late; the law is `stribeck`.

The law is named; of axes it is chosen, too, in some of the seeds. For drives on a spring
`benchmarks.identification` tells whether it is found.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from math import exp, inf
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks import identification as study
from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.even_clock import evenly_spaced
from stickslip_ros.identification.identified_law import DELAY, LAG
from stickslip_ros.identification.identify import identify
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.servo import Servo, closed_loop
from stickslip_ros.installed_packages import versions
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Directional

CASES = (
    *(f"axis {rate} 0" for rate in (250, 500, 1000, 2000)),
    *(f"axis 500 {dwell}" for dwell in (0.1, 0.45, 0.72)),
    "uneven",
    "coast coulomb",
    "coast exponential",
    *(f"late {delay} 0" for delay in (1, 2, 5)),
    *(f"late 0 {lag}" for lag in (1, 2, 5)),
    "late 1 1",
)
SERVO = Servo(position_gain=1.5e5, velocity_gain=3.3e3, difference_samples=2, limit=inf)
AXIS = Drive(38.0, 0.0, 0.0, 1.0, 0.0, Directional(Coulomb(17.0, 140.0), Coulomb(21.0, 180.0)))
COASTING: dict[str, Callable[[float], float]] = {
    "coulomb": lambda speed: 9.0 + 14.0 * speed,
    "exponential": lambda speed: 8.0 + 7.0 * exp(-speed / 0.1) + 10.0 * speed,
}
COASTING_MASS = 40.0
COASTING_VALUES = {
    "coulomb": {"friction.static": 9.0, "friction.viscous": 14.0},
    "exponential": {
        "friction.static": 15.0,
        "friction.kinetic": 8.0,
        "friction.decay_speed": 0.1,
        "friction.viscous": 10.0,
    },
}
"""Friction of axes that coast, N, by the speed, m/s; mass, kg; constants."""
AXIS_VALUES = 38.0, 17.0, 140.0, 21.0, 180.0


def named(*values: float) -> dict[str, float]:
    """Return mass and Coulomb friction by direction by their names as constants."""
    names = ("static", "viscous", "reverse.static", "reverse.viscous")
    return dict(zip(("mass", *(f"friction.{each}" for each in names)), values, strict=True))


def axis_record(
    rate: int,
    dwell: float,
    seed: int,
    count: int = 6000,
    encoder: float = 2e-6,
    noise: float = 0.5,
) -> Record:
    """Return a run of `AXIS` along six sines that stand still for a share of every 2 s."""
    time, random = np.arange(count) / rate, np.random.default_rng(seed)
    frequencies, moving = np.array([0.2, 0.37, 0.61, 0.97, 1.6, 2.7]), time % 2.0 >= 2.0 * dwell
    phases = 2.0 * np.pi * np.cumsum(moving)[:, None] / rate * frequencies
    sines = np.sin(phases + np.arange(6.0) + 0.1 * seed)
    reference, still = (sines - sines[0]) @ (0.007 / frequencies), np.zeros(count)
    start = Record("axis", 1.0 / rate, still, still, reference=reference)
    position, force = closed_loop(start, AXIS, SERVO, 0.0)
    measured = np.rint(position / encoder) * encoder
    return replace(start, position=measured, force=force + noise * random.standard_normal(count))


def uneven_record(seed: int, count: int = 5000) -> Record:
    """Return a motion of 4 kg in closed form; it turns so slowly that it might rest."""
    random = np.random.default_rng(seed)
    time = np.cumsum(random.choice([0.010, 0.012], p=[0.7, 0.3], size=count))
    rates, sizes = 2.0 * np.pi * np.array([0.1, 0.23, 0.6]), np.array([0.6, 0.2, 0.06])
    angles = rates * time[:, None] + np.array([0.3, 1.1, 2.0])
    velocity = np.cos(angles) @ (sizes * rates)
    force = -4.0 * np.sin(angles) @ (sizes * rates**2) + 11.0 * velocity + 7.0 * np.sign(velocity)
    columns = {
        "position": np.round(np.sin(angles) @ sizes, 4),
        "belt_velocity": 0.0 * time,
        "force": force + 0.2 * random.standard_normal(count),
    }
    return evenly_spaced("log", np.rint(1e9 * time).astype(np.int64), columns)[0]


def coasting_record(law: str, seed: int, run: int) -> Record:
    """Return a run of an axis that coasts to rest, and rests for 0.3 s."""
    random = np.random.default_rng([seed, run])

    def moved(_: float, state: FloatArray) -> list[float]:
        falls = (state[1] > 0.0) * COASTING[law](state[1])
        return [state[1], -falls / COASTING_MASS]

    def rests(_: float, state: FloatArray) -> float:
        return state[1]

    rests.terminal = True
    start = [0.0, random.uniform(0.3, 0.8)]
    found = solve_ivp(
        moved,
        (0.0, 60.0),
        start,
        events=rests,
        rtol=1e-10,
        atol=1e-12,
        max_step=0.05,
        dense_output=True,
    )
    end = float(found.t[-1])
    time = np.arange(0.0, end + 0.3, 1e-3)
    position = found.sol(np.minimum(time, end))[0] + 2e-6 * random.standard_normal(len(time))
    return Record("coast", 1e-3, np.rint(position / 1e-6) * 1e-6, np.zeros(len(time)))


def records_of(case: str, seed: int) -> list[Record]:
    """Return the records of a case without a spring."""
    kind, *rest = case.split()
    if kind == "coast":
        return [coasting_record(rest[0], seed, run) for run in range(3)]
    if kind == "uneven":
        return [uneven_record(seed)]
    return [axis_record(int(rest[0]), float(rest[1]), seed)]


def law_of(case: str) -> str:
    """Return the law of a case without a spring."""
    return case.split()[1] if case.startswith("coast") else "coulomb"


def given_of(case: str) -> dict[str, float]:
    """Return the constants that are given in a case without a spring."""
    return {"mass": COASTING_MASS} if case.startswith("coast") else {}


def tried(case: str, seed: int) -> tuple[dict[str, list[float]], float]:
    """Return error and standard error of each constant, and the delay, s."""
    kind, *numbers = case.split()
    if kind == "late":
        delay, lag = (1e-3 * float(each) for each in numbers)
        true = study.truth("stribeck", "taps") | {DELAY: delay, LAG: lag}
        own = study.record("stribeck", "taps", seed, delay=delay, lag=lag)
        found = identify([own], "stribeck", {"normal_force": study.NORMAL_FORCE})
    else:
        true = named(*(AXIS_VALUES if kind == "axis" else (4.0, 7.0, 11.0, 7.0, 11.0)))
        true = COASTING_VALUES[numbers[0]] if kind == "coast" else true
        found = identify(records_of(case, seed), law_of(case), given_of(case))
    errors = {
        name: [each.value - true.get(name, 0.0), each.standard_error]
        for name, each in found.fitted.items()
    }
    return errors, found.chosen.delay


def summary(case: str, seeds: int, choices: int = 0) -> dict[str, Any]:
    """Return coverage and delays over the seeds of a case, and how often the law is chosen.

    It is chosen from all laws in the first `choices` seeds, of an axis.
    """
    trials = [tried(case, seed) for seed in range(seeds)]
    pairs = [pair for errors, _ in trials for pair in errors.values()]
    choices = 0 if case.startswith("late") else min(choices, seeds)
    chosen = [identify(records_of(case, seed), fixed=given_of(case)).law for seed in range(choices)]
    return {
        "case": case,
        "seeds": seeds,
        "intervals": len(pairs),
        "covered": float(np.mean([abs(error) <= study.QUANTILE * s for error, s in pairs])),
        "delays": [delay for _, delay in trials],
        "choices": choices,
        "right": chosen.count(law_of(case)),
    }


def main() -> None:
    """Print the study as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--choices", type=int, default=20)
    parser.add_argument("--cases", nargs="*", default=CASES)
    arguments = parser.parse_args()
    cases = [summary(case, arguments.seeds, arguments.choices) for case in arguments.cases]
    print(json.dumps({"cases": cases, "versions": versions()}, indent=1))


if __name__ == "__main__":
    main()
