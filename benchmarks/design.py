"""Does `design` find gains wherever a dense grid has some, and do its proposals hold?

Random drives with and without a motor behind the spring: 20 to 2,000 kg, 3 to 60 Hz, coefficients
of friction of 0.05 to 0.3 that fall by a tenth to a half within 1 to 50 mm/s, belt speeds of 1 to
100 mm/s, an encoder of 0.1 to 5 um, a delay of 0 to 2 ms and 0.5 to 4 kHz.

Of a grid, those points count that are stable, keep the limits of the design, and hold in
simulation. Proposals are simulated at other belt speeds of their range, under a step of a tenth of
the friction.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from stickslip_ros.installed_packages import versions
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.studies.case_outcome import Disturbance, simulate_case
from stickslip_ros.studies.design import Task, design
from stickslip_ros.studies.design_trial import Trial
from stickslip_ros.studies.drive_loops import DriveLoops
from stickslip_ros.studies.tuning import Tuning

DRIVES = 60
LAWS = {False: ("washout", "velocity_feedback", "pid"), True: ("cascade", "pid")}
"""Laws that are designed, by whether there is a motor."""
_POINTS = {1: 600, 2: 70, 3: 18}
"""Points of the grid along each axis, by the number of gains."""
_JUDGED = 400
"""Largest number of stable points of the grid that are compared with the limits."""


@dataclass(frozen=True)
class Result:
    """A design beside the grid; decay rates in 1/s, None without gains."""

    seed: int
    law: str
    motor: bool
    decay_rate: float | None
    of_grid: float | None  # of the best point that counts and is at least 1.25 times as fast
    held: list[bool]  # of a proposal, at belt speeds between those of the design
    force_ratios: list[float]  # simulated over predicted peak force
    remark: str | None

    @property
    def found(self) -> bool:
        """Whether the design is at least 0.8 times as fast as the grid."""
        return self.of_grid is None


def task(seed: int) -> Task:
    """Return the task of a random drive."""
    random = np.random.default_rng(seed)

    def among(low: float, high: float) -> float:
        return float(low * (high / low) ** random.uniform())

    motor = bool(seed % 2)
    mass, frequency, static = among(20.0, 2000.0), 2.0 * pi * among(3.0, 60.0), among(0.05, 0.3)
    load = mass * 9.81 * random.uniform(1.0, 2.0)
    fallen, width = static * random.uniform(0.5, 0.9), among(0.001, 0.05)
    lowest = among(0.001, 0.1)
    belt_speeds = lowest, min(lowest * among(1.0, 10.0), 0.1)
    values: dict[str, Any] = {
        "mass": mass,
        "stiffness": mass * frequency**2,
        "damping": 2.0 * mass * frequency * among(0.005, 0.05),
        "normal_force": load,
        "belt_speed": belt_speeds[0],
        "rate": among(500.0, 4000.0),
        "force_delay": random.uniform(0.0, 0.002),
        "friction.law": "stribeck" if belt_speeds[1] < width else "exponential",
        "friction.static": static,
    }
    if values["friction.law"] == "stribeck":
        values |= {"friction.minimum": fallen, "friction.minimum_speed": width}
    else:
        values |= {"friction.kinetic": fallen, "friction.decay_speed": width}
    encoder = {
        "position_resolution": among(1e-7, 5e-6),
        "velocity": "difference",
        "difference_samples": int(random.integers(1, 5)),
    }
    values |= {f"sensor.{name}": value for name, value in encoder.items()}
    if motor:
        values |= {f"motor.sensor.{name}": value for name, value in encoder.items()}
        values |= {"motor.kind": "mass", "motor.mass": mass * among(0.3, 2.0)}
        values |= {"motor.damping": 0.02 * mass * frequency, "motor.friction": 0.1 * static * load}
    law = str(random.choice(LAWS[motor]))
    scenario = load_scenario("feed_drive", controller=law)
    changed = {f"plant.{name}": value for name, value in values.items()}
    changed[f"{law}_controller.force_limit"] = static * load * among(0.3, 5.0)
    return Task.from_scenario(scenario.changed(changed), belt_speeds)


def grid(loops: DriveLoops, bodies: Sequence[ControlLaw]) -> Iterator[list[ControlLaw]]:
    """Yield parts of the grid: laws with gains over decades, for each body to feed back."""
    law, drive = loops.law, loops.drive
    mass, rate = drive.mass, loops.plants[0].loop.rate
    omega, count = drive.angular_frequency, len(law.tuned)
    ranges = {
        "1/s": (omega / 300.0, 3.0 * rate),
        "N s/m": (mass * omega / 300.0, 10.0 * mass * rate),
        "N/m": (mass * omega**2 / 300.0, 10.0 * mass * rate**2),
        "N/(m s)": (mass * omega**3 / 300.0, 10.0 * mass * rate**3),
        "rad/s": (omega / 300.0, 3.0 * rate),
    }
    described = {name: constant.unit for name, constant in constants_of(type(law)).items()}
    axes = [np.geomspace(*ranges[described[name] or ""], _POINTS[count]) for name in law.tuned]
    signs = -1.0 if law.name in ("washout", "velocity_feedback") else 1.0
    for body in bodies:
        laws: list[ControlLaw] = []
        for gains in product(*axes):
            values = dict(zip(law.tuned, map(float, gains), strict=True))
            if "linear_gain" in values or law.name == "velocity_feedback":
                values[law.tuned[-1]] *= signs
            laws.append(replace(body, **values))
        yield from (laws[start : start + 4096] for start in range(0, len(laws), 4096))


def best_of_grid(trial: Trial, bodies: Sequence[ControlLaw], least: float) -> float | None:
    """Return the decay rate of the fastest point that counts, if it is above `least`."""
    loops, parts = trial.loops, [*grid(trial.loops, bodies)]
    laws = [law for part in parts for law in part]
    rates = np.concatenate([loops.decay_rates(part) for part in parts])
    order = np.argsort(-rates)
    stable = order[: int((rates > least).sum())]
    if len(stable) > _JUDGED:
        stable = stable[np.unique(np.linspace(0, len(stable) - 1, _JUDGED).astype(int))]
    for row in stable.tolist():
        limits = loops.limits(laws[row], loops.deciding)
        if max(limit.excess for limit in limits) > 0.0:
            continue
        if all(check.reason is None for check, _ in trial.checks(laws[row])):
            return float(rates[row])
    return None


def compare(seed: int) -> Result:
    """Return the result of a random drive."""
    asked = task(seed)
    scenario, law = asked.scenario, asked.scenario.controller.law
    disturbances = [Disturbance.parse(kind, scenario) for kind in ("step", "impulse")]
    found = design(asked, disturbances=disturbances)
    least, held, ratios = 0.0, list[bool](), list[float]()
    rate = None
    if found.controller is not None and found.tuned is not None:
        rate = found.tuned.decay_rate
        least = rate / 0.8
        held = [simulated(found.scenario, asked, share, rate) for share in (0.37, 0.81)]
        ratios = [
            check.disturbed_force / check.predicted_peak_force
            for check in found.checks
            if check.disturbed_force and check.predicted_peak_force
        ]
    trial, of_grid = Trial(asked, disturbances), None
    if trial.loops.diverges is None:
        # Where the body that the scenario names has gains, a design feeds back no other one.
        bodies = Tuning(trial.loops).bodies
        if found.controller is not None and found.controller.of_motor == bodies[0].of_motor:
            bodies = bodies[:1]
        of_grid = best_of_grid(trial, bodies, least)
    return Result(seed, law, bool(seed % 2), rate, of_grid, held, ratios, found.remark)


def simulated(scenario: Scenario | None, asked: Task, share: float, rate: float) -> bool:
    """Return whether a proposal holds for 30 periods and more after a step."""
    assert scenario is not None
    low, high = asked.belt_speeds
    step = Disturbance.parse("step", scenario)
    duration = max(90.0 * asked.drive.natural_period, 18.0 / rate)
    values = {"plant.belt_speed": low + share * (high - low), **step.parameters(duration)}
    return bool(simulate_case(scenario.changed(values), duration, step, 0.05).held)


def figures(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of results, as rows of a file."""
    proposed = [row for row in rows if row["decay_rate"] is not None]
    ratios = [max(row["force_ratios"]) for row in proposed]
    return {
        "drives": len(rows),
        "proposals": len(proposed),
        "grid_is_faster": sum(row["of_grid"] is not None for row in rows),
        "proposals_not_held": sum(not all(row["held"]) for row in proposed),
        "force_ratio_median": float(np.median(ratios)),
        "force_ratio_largest": max(ratios),
    }


def main() -> int:
    """Print the figures; return 1 if the grid has gains that the design has not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--drives", type=int, default=DRIVES)
    parser.add_argument(
        "--write", action="store_true", help="write design.json, with its results of other drives"
    )
    arguments = parser.parse_args()
    path, rows = Path(__file__).with_suffix(".json"), dict[int, dict[str, Any]]()
    if arguments.write and path.exists():
        rows = {row["seed"]: row for row in json.loads(path.read_text())["results"]}
    for seed in range(arguments.first, arguments.first + arguments.drives):
        row = asdict(compare(seed))
        print(row, flush=True)
        rows[seed] = {**row, "force_ratios": [round(max(row["force_ratios"], default=0.0), 3)]}
    ordered = [rows[seed] for seed in sorted(rows)]
    found = figures(ordered)
    print(json.dumps(found, indent=1))
    if arguments.write:
        written = {**found, "results": ordered, "versions": versions()}
        path.write_text(json.dumps(written, indent=1) + "\n")
    return int(bool(found["grid_is_faster"] or found["proposals_not_held"]))


if __name__ == "__main__":
    sys.exit(main())
