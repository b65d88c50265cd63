"""Do measures through an encoder agree with those of the motion itself, within their errors?

Random feed drives with friction of five laws, each from stick fractions of 0 to 0.97 and from 30 to
3,000 encoder steps in a swing, sampled 100 to 4,000 times a second. Every tenth slides evenly. Each
is simulated with an encoder; the motion behind it, measured without, is the truth.

A regime is right or null, with a reason. Amplitude, period and stick fraction are compared with the
truth in standard errors; for these, 99 % of the deviations are to lie within 3, and 92 to 98 %
within 2.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import stickslip_ros as ss
from stickslip_ros.installed_packages import versions

LAWS = ("stribeck", "exponential", "gaussian", "stiction", "linear")
VALUES = ("amplitude", "period", "stick_fraction")
DRIVES = 60
_RATES = (100.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0)
_NEAR = 0.06
_LONGEST, _CYCLES, _TRANSIENT, _LEAST_SAMPLES = 60.0, 20, 12, 12


@dataclass(frozen=True)
class Comparison:
    """Measures through an encoder beside the truth."""

    seed: int
    law: str
    rate: float
    steps: float  # in a swing
    noise: float  # steps
    stick_fraction: float  # true
    regime: str | None
    true_regime: str | None
    notes: bool
    deviations: dict[str, float]  # standard errors
    unknown: list[str]
    wide: bool


def friction(random: np.random.Generator, law: str, fall: float) -> dict[str, Any]:
    """Return parameters of a law whose coefficient falls over about `fall`, a speed (m/s)."""
    static = random.uniform(0.1, 0.5)
    lower = static * random.uniform(0.4, 0.9)
    speed = fall * 10.0 ** random.uniform(-1.5, 0.3)
    values: dict[str, Any] = {"friction_law": law, "friction_static": static}
    match law:
        case "stribeck":
            values |= {"friction_minimum": lower, "friction_minimum_speed": 2.0 * speed}
        case "linear":
            values["friction_slope"] = (static - lower) / speed
        case _:
            values["friction_kinetic"] = lower
    if law in ("exponential", "gaussian"):
        exponent = 1.0 if law == "exponential" else 2.0
        values |= {"friction_law": "exponential", "friction_exponent": exponent,
                   "friction_decay_speed": speed}  # fmt: skip
    return values


def exact_drive(random: np.random.Generator, law: str, target: float) -> Any:
    """Return a drive, a duration (s) and exact measures; None where the draw has no such cycle.

    The belt speed is bisected for the stick fraction `target`; infinite asks for an equilibrium.
    """
    mass, omega = random.uniform(5.0, 400.0), 2.0 * np.pi * 10.0 ** random.uniform(0.4, 1.6)
    natural, fall = 2.0 * np.pi / omega, 10.0 ** random.uniform(-3.0, -0.7)
    plain = ss.scenario(
        "feed_drive",
        controller=None,
        mass=mass,
        stiffness=mass * omega**2,
        damping=2.0 * mass * omega * random.uniform(0.01, 0.2),
        normal_force=9.81 * mass,
        rate=20.0 / natural,
        **friction(random, law, fall),
    )
    slow, fast = fall * 10.0**-2.5, fall * 10.0**0.8
    for _ in range(9):
        feed = float(np.sqrt(slow * fast))
        moving = ss.scenario(plain, belt_speed=feed)
        measures = ss.simulate(moving, duration=120.0 * natural).measures
        cycles = measures.regime in ("stick_slip", "pure_slip")
        duration = (_CYCLES + _TRANSIENT) * (measures.period or natural)
        if measures.steady is True and duration < _LONGEST:
            if measures.regime == "equilibrium" and target == np.inf:
                return moving, duration, measures
            if cycles and abs((measures.stick_fraction or 0.0) - target) < _NEAR:
                return moving, duration, measures
        sticks = measures.regime is None or (measures.stick_fraction or 0.0) > target
        slow, fast = (feed, fast) if sticks or target == np.inf else (slow, feed)
    return None


def drive(seed: int) -> tuple[ss.Scenario, float, dict[str, float]]:
    """Return a drive by its number, its duration (s), and its encoder."""
    random = np.random.default_rng([seed, 681])
    even = seed % 10 == 9
    while True:
        target = np.inf if even else float(random.uniform(0.0, 0.97))
        exact = exact_drive(random, LAWS[seed % len(LAWS)], target)
        if exact is None:
            continue
        moving, duration, true = exact
        rates = [rate for rate in _RATES if rate * (true.period or 1.0) >= _LEAST_SAMPLES]
        if rates:
            break
    size = 2.0 * moving.plant.belt_speed if even else 2.0 * true.amplitude
    steps = 10.0 ** random.uniform(1.5, 3.5)
    noise = float(random.choice([0.0, 0.0, 0.3, 1.0])) if steps > 100.0 else 0.0
    measured = ss.scenario(
        moving,
        rate=float(random.choice(rates)),
        sensor_position_resolution=size / steps,
        sensor_position_noise=noise * size / steps,
        sensor_velocity="difference",
        sensor_difference_samples=int(random.choice([1, 2, 4, 8])),
        sensor_seed=seed,
    )
    return measured, duration, {"steps": steps, "noise": noise}


def comparison(seed: int) -> Comparison:
    """Return measures of a drive beside its truth."""
    scenario, duration, encoder = drive(seed)
    run = ss.simulate(scenario, duration=duration)
    seen, true, errors = run.measures, run.truth, dict(run.measures.errors or {})
    assert true is not None
    cycles = true.regime in ("stick_slip", "pure_slip") and true.steady is True
    pairs = {name: (getattr(seen, name), getattr(true, name)) for name in VALUES if cycles}
    known = {name: pair for name, pair in pairs.items() if pair[0] is not None and errors}
    return Comparison(
        seed=seed,
        law=LAWS[seed % len(LAWS)],
        rate=scenario.plant.rate,
        **encoder,
        stick_fraction=true.stick_fraction or 0.0,
        regime=seen.regime,
        true_regime=true.regime,
        notes=bool(run.notes),
        deviations={
            name: (value - truth) / errors[name] if errors.get(name) else 1e3 * (value != truth)
            for name, (value, truth) in known.items()
        },
        unknown=[name for name in pairs if name not in known],
        wide=errors.get("stick_fraction", 0.0) > 0.1,
    )


def right(regime: str | None, true: str | None) -> bool:
    """Is a regime the true one, or one that the encoder cannot tell from it?"""
    return regime == true or {regime, true} == {"equilibrium", "held"}


def counts(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return how many regimes are right, and which deviations lie within 2 and 3 errors."""
    deviations = [abs(value) for each in found for value in each["deviations"].values()]
    return {
        "drives": len(found),
        "regimes": dict(Counter(
            "right" if right(each["regime"], each["true_regime"])
            else "null" if each["regime"] in (None, "undersampled") else "wrong"
            for each in found
        )),
        "deviations": len(deviations),
        "within 2 errors": round(float(np.mean(np.array(deviations) <= 2.0)), 4),
        "within 3 errors": round(float(np.mean(np.array(deviations) <= 3.0)), 4),
    }  # fmt: skip


def main() -> int:
    """Run the study; return 1 if a regime is wrong or deviations are larger than the errors say."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.encoder_drives",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=DRIVES, help=f"default: {DRIVES}")
    parser.add_argument("--first", type=int, default=0, help="number of the first; default: 0")
    parser.add_argument("--workers", type=int, default=None, help="processes")
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write JSON to this file")
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.drives)
    with ProcessPoolExecutor(arguments.workers) as pool:
        rows = [asdict(each) for each in pool.map(comparison, numbers)]
    found: dict[str, Any] = {"counts": counts(rows), "drives": rows, "versions": versions()}
    for row in rows:
        worst = max(map(abs, row["deviations"].values()), default=0.0)
        if worst > 3.0 or not right(row["regime"], row["true_regime"]):
            print(json.dumps(row))
    print(json.dumps(found["counts"], indent=2))
    if arguments.out is not None:
        arguments.out.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    total = found["counts"]
    return int("wrong" in total["regimes"] or total["within 3 errors"] < 0.99)


if __name__ == "__main__":
    sys.exit(main())
