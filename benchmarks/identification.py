"""Do the intervals of `stickslip identify` cover, and does it recover the law?

Runs of a drive like feed_drive with an encoder of 1 um, whose difference a washout controller
uses, and a force that is rounded to 0.1 N. In `ramp` the belt speed rises from 20 to 60 mm/s, in
`taps` it is 30 mm/s; both have taps of 60 to 200 N. `stick` is stick-slip at 20 mm/s without
control; the mass is given: without a force only ratios are identifiable. `narrow` is a belt of
60 mm/s with taps of 5 to 15 N: all relative speeds are alike, and the law is not identifiable.
The start, the taps, the belt speed (by 10 %) and all rounding differ from seed to seed.

No cycle takes a whole number of samples and no coefficient a whole number of encoder steps:
rounding errors that repeat in each cycle are no noise.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from stickslip_ros.identification.choice import AUTO
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import QUANTILE
from stickslip_ros.identification.identify import identify
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.sentences import unidentified
from stickslip_ros.installed_packages import versions
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Coulomb,
    Exponential,
    FrictionLaw,
    LuGre,
    Stiction,
    Stribeck,
)
from stickslip_ros.model.signals import table
from stickslip_ros.motion import Motion

NORMAL_FORCE = 1000.0
_CURVE = Exponential(static=0.4037, kinetic=0.2519, decay_speed=0.0203, viscous=0.507)
LAWS: dict[str, FrictionLaw] = {
    "stribeck": Stribeck(static=0.4037, minimum=0.2519, minimum_speed=0.0507),
    "exponential": _CURVE,
    "coulomb": Coulomb(static=0.3029, viscous=0.807),
    "stiction": Stiction(static=0.4037, kinetic=0.2519, viscous=0.507),
    "lugre": LuGre(_CURVE, bristle_stiffness=2e4, bristle_damping=1.0),
}
CASES = (
    *product(("stribeck", "exponential", "coulomb", "lugre"), ("ramp", "taps")),
    ("stribeck", "stick"),
    ("exponential", "stick"),
    ("lugre", "stick"),
    ("stribeck", "narrow"),
    ("exponential", "narrow"),
)
"""Law and kind of run. Coulomb friction does not vibrate by itself."""
BELTS = {"ramp": (0.02, 0.06), "taps": (0.03, 0.03), "stick": (0.02, 0.02), "narrow": (0.06, 0.06)}
"""Belt speed at the start and at the end of a run, m/s."""
TAPS = {"ramp": (60.0, 200.0), "taps": (60.0, 200.0), "narrow": (5.0, 15.0)}
"""Size of the taps, N; without any there is no control."""
SEEDS = 100
DURATION = 4.0
RESOLUTION, FORCE_STEP, PERIOD = 1e-6, 0.1, 1e-3
MASS, STIFFNESS = 104.0, 1e6


def damping(law: str, kind: str) -> float:
    """Return the damping, N s/m: where it merges with viscous friction there is none."""
    return 200.0 if (law, kind) == ("stribeck", "ramp") else 0.0


def record(
    law: str, kind: str, seed: int, duration: float = DURATION, delay: float = 0.0, lag: float = 0.0
) -> Record:
    """Return a run as a machine would log it, whose control force may be late, s.

    Taps are then part of the command.
    """
    random = np.random.default_rng(seed)
    count = round(duration / PERIOD)
    first, last = np.array(BELTS[kind]) * random.uniform(0.9, 1.1)
    times = (0.0, 0.2 * duration, 0.8 * duration, duration)
    speeds = (first, first, last, last)
    drive = Drive(
        mass=MASS,
        damping=damping(law, kind),
        stiffness=STIFFNESS,
        normal_force=NORMAL_FORCE,
        belt_speed=0.0,
        friction=LAWS[law],
        belt=table(list(zip(times, speeds, strict=True))),
        actuator=Actuator(time_constant=lag),
    )
    belt = np.interp(PERIOD * np.arange(count), times, speeds)
    taps, gain = np.zeros(count), 0.0
    if kind in TAPS:
        gain, place = -1500.0, 0
        while place < count:
            place += int(random.uniform(150, 350))
            size = random.choice([-1.0, 1.0]) * random.uniform(*TAPS[kind])
            taps[place : place + int(random.uniform(10, 30))] = round(size / FORCE_STEP)
    taps *= FORCE_STEP
    motion = Motion(drive, 2.6e-4 * random.uniform(0.5, 1.0), 0.0)
    position, force = np.empty(count), np.zeros(count)
    slow, before = 0.0, None
    late, (whole, rest) = delay > 0.0 or lag > 0.0, divmod(round(delay / PERIOD, 9), 1.0)
    whole = int(whole)
    for number in range(count):
        measured = round(motion.position / RESOLUTION) * RESOLUTION
        position[number] = measured
        velocity = 0.0 if before is None else (measured - before) / PERIOD
        before = measured
        force[number] = round(gain * (velocity - slow) / FORCE_STEP) * FORCE_STEP
        slow += 20.0 * PERIOD * (velocity - slow)
        if not late:
            motion.set_forces(float(force[number]), float(taps[number]))
            motion.advance(PERIOD)
            continue
        force[number] += taps[number]
        for place, share in ((number - whole - 1, rest), (number - whole, 1.0 - rest)):
            motion.set_forces(float(force[place]) if place >= 0 else 0.0, 0.0)
            if share > 0.0:
                motion.advance(share * PERIOD)
    if late:
        taps[:] = 0.0
    return Record(f"{law}, {kind}, seed {seed}", PERIOD, position, belt, force, taps)


def truth(law: str, kind: str) -> dict[str, float]:
    """Return the constants of a run by parameter of the plant."""
    own = LAWS[law]
    curve = own.curve if isinstance(own, LuGre) else own
    found = {"mass": MASS, "stiffness": STIFFNESS, "damping": damping(law, kind)}
    found |= {
        f"friction.{name}": value for name, value in vars(curve).items() if name != "switches"
    }
    if isinstance(own, LuGre):
        for name in ("bristle_stiffness", "bristle_damping"):
            found[f"friction.{name}"] = getattr(own, name)
    return found


def tried(law: str, kind: str, seed: int) -> dict[str, Any]:
    """Return the law that was found for a seed, whether it is told, and the errors."""
    known = {"normal_force": NORMAL_FORCE}
    if kind == "stick":
        known["mass"] = MASS
    begun = time.process_time()
    found: Findings = identify([record(law, kind, seed)], AUTO, known, time_limit=inf)
    untold = unidentified(found)
    result: dict[str, Any] = {
        "law": found.law,
        "told": "friction.law" not in untold,
        "seconds": time.process_time() - begun,
    }
    if found.law == law:
        true = truth(law, kind)
        result["errors"] = {
            name: [each.value - true[name], each.standard_error]
            for name, each in found.fitted.items()
            if name in true and name not in untold
        }
    return result


def summary(law: str, kind: str, trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return shares and biases over the seeds of a case."""
    errors: dict[str, list[tuple[float, float]]] = {}
    for trial in trials:
        for name, (error, standard) in trial.get("errors", {}).items():
            errors.setdefault(name, []).append((error, standard))
    constants = {
        name: {
            "seeds": len(pairs),
            "covered": float(np.mean([abs(error) <= QUANTILE * s for error, s in pairs])),
            "bias": float(np.mean([error for error, _ in pairs])),
            "scatter": float(np.std([error for error, _ in pairs])),
            "standard_error": float(np.median([s for _, s in pairs])),
        }
        for name, pairs in errors.items()
    }
    return {
        "law": law,
        "kind": kind,
        "seeds": len(trials),
        "right": float(np.mean([trial["law"] == law for trial in trials])),
        "told": float(np.mean([trial["told"] for trial in trials])),
        "seconds": float(np.median([trial["seconds"] for trial in trials])),
        "constants": constants,
    }


def study(
    seeds: int, workers: int | None = None, cases: Iterable[tuple[str, str]] = CASES
) -> dict[str, Any]:
    """Return the summaries of all cases."""
    found: list[dict[str, Any]] = []
    with ProcessPoolExecutor(workers) as pool:
        for law, kind in cases:
            own = list(pool.map(tried, [law] * seeds, [kind] * seeds, range(seeds)))
            found.append(summary(law, kind, own))
            print(json.dumps(found[-1]), file=sys.stderr, flush=True)
    return {"cases": found, "versions": versions()}


def main() -> None:
    """Write the study as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--cases", nargs="*", metavar="LAW,KIND")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    cases = [tuple(each.split(",")) for each in arguments.cases] if arguments.cases else CASES
    text = json.dumps(study(arguments.seeds, arguments.workers, cases), indent=1) + "\n"
    if arguments.out is None:
        print(text, end="")
    else:
        arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
