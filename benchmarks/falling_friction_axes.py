"""Is `stickslip identify` right about axes whose friction falls, or does it say that it is not?

Random axes without a spring, 20 to 400 kg, under position control, along strokes with reversals:
LuGre friction with presliding of 1 to 30 um, and friction by the Stribeck curve that sticks at
once. It falls by a tenth to a half within 1 to 30 mm/s. The encoder has steps of 1 um, the force
noise of 1 %, and every other recording has the reference. The first ones are fixed: an axis of
250 kg, and a pair of 40 kg that differs in the stiffness of its bristles alone.

The integrator is none of the package: bristles and viscous friction are exact over a step at
constant speed, and an axis without bristles stops within a step where its friction can hold it
(J. J. Moreau, Numerical aspects of the sweeping process, 1999).

Of the friction at the speeds that were driven the share inside its interval is counted, where it is
said to be known; and the free runs that are off by more than 30 % of the motion without a note.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import QUANTILE
from stickslip_ros.identification.identify import identify
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.sentences import notes
from stickslip_ros.installed_packages import versions

AXES, DURATION, STEP = 40, 12.0, 2e-5
ENCODER, FORCE_NOISE = 1e-6, 0.01
FAR = 0.3
"""Error of a free run, as a share of the motion, from which a note is due."""


@dataclass(frozen=True)
class Axis:
    """An axis, SI units."""

    mass: float
    kinetic: float
    rise: float
    """Static less kinetic friction, N."""
    decay_speed: float
    viscous: float
    bristles: float
    """Stiffness of the bristles, N/m; infinite: none."""
    period: float
    fastest: float
    reference: bool = True
    exponent: float = 1.0

    def friction(self, speed: FloatArray) -> FloatArray:
        """Return friction in steady slip, N, at speeds |v|, m/s."""
        fall = np.exp(-((speed / self.decay_speed) ** self.exponent))
        return self.kinetic + self.rise * fall + self.viscous * speed


FIXED = (
    Axis(250.0, 275.0, 175.0, 0.010, 900.0, 2e7, 2e-3, 0.08, reference=False),
    Axis(40.0, 20.0, 10.0, 0.010, 80.0, 2e7, 1e-3, 0.1),
    Axis(40.0, 20.0, 10.0, 0.010, 80.0, 2e6, 1e-3, 0.1),
)


def axis(number: int) -> Axis:
    """Return an axis by number."""
    if number < len(FIXED):
        return FIXED[number]
    random = np.random.default_rng((71, number))
    mass = 20.0 * 20.0 ** random.uniform()
    static = 9.81 * mass * random.uniform(0.05, 0.3)
    rise = static * random.uniform(0.1, 0.5)
    decay, fastest = 1e-3 * 30.0 ** random.uniform(), random.uniform(0.05, 0.2)
    viscous = random.uniform(0.1, 0.8) * (static - rise) / fastest
    stiffness = static / (1e-6 * 30.0 ** random.uniform()) if number % 3 else np.inf
    period, exponent = random.choice([1e-3, 2e-3]), random.choice([1.0, 2.0])
    values = mass, static - rise, rise, decay, viscous, stiffness, period, fastest
    return Axis(*map(float, values), reference=bool(number % 2), exponent=float(exponent))


def _reference(axis: Axis, number: int, duration: float) -> FloatArray:
    """Return smooth strokes there and back at random speeds, m, by sample."""
    random, count = np.random.default_rng((72, number)), round(duration / axis.period)
    speed, place, sign = np.zeros(count), 0, 1.0
    while place < count:
        length = round(random.uniform(0.3, 0.9) / axis.period)
        speed[place : place + length] = sign * axis.fastest * 10.0 ** random.uniform(-1.0, 0.0)
        place, sign = place + length, -sign
    window = np.hanning(round(random.uniform(0.1, 0.3) / axis.period))
    return axis.period * np.cumsum(np.convolve(speed, window / window.sum(), "same"))


@cache
def records(numbers: tuple[int, ...], duration: float = DURATION) -> dict[int, Record]:
    """Return the recordings of axes by number; those of one sample rate are simulated together."""
    made: dict[int, Record] = {}
    for period in sorted({axis(number).period for number in numbers}):
        alike = [number for number in numbers if axis(number).period == period]
        made |= zip(alike, _simulated(alike, duration), strict=True)
    return made


def _simulated(numbers: Sequence[int], duration: float) -> list[Record]:
    axes = [axis(number) for number in numbers]
    period, names = axes[0].period, ("mass", "kinetic", "rise", "decay_speed", "exponent")
    mass, kinetic, rise, decay, exponent = (
        np.array([getattr(each, name) for each in axes]) for name in names
    )
    viscous, stiffness = (np.array([getattr(a, n) for a in axes]) for n in ("viscous", "bristles"))
    bristled = np.isfinite(stiffness)
    stiffness[~bristled] = 1.0
    references = np.array(
        [_reference(each, n, duration) for each, n in zip(axes, numbers, strict=True)]
    ).T
    damping = 0.3 * np.sqrt(stiffness * mass) * bristled
    rate = 2.0 * np.pi * 15.0
    position, speed, state = (np.zeros(len(axes)) for _ in range(3))
    last, seen, forces = position, np.empty_like(references), np.empty_like(references)
    for sample, wanted in enumerate(references):
        measured = np.rint(position / ENCODER) * ENCODER
        force = mass * rate * (rate * (wanted - measured) - 1.4 * (measured - last) / period)
        last, seen[sample], forces[sample] = measured, measured, force
        for _ in range(round(period / STEP)):
            size = np.abs(speed)
            curve = kinetic + rise * np.exp(-((size / decay) ** exponent))
            # Bristles follow their steady deflection exactly while the speed is constant.
            kept = np.exp(-stiffness * size * STEP / curve)
            steady = np.where(speed < 0.0, -curve, curve) / stiffness
            before, state = (
                state,
                np.where(size > 0.0, steady + (state - steady) * kept, state + speed * STEP),
            )
            bristles = stiffness * state + damping * (state - before) / STEP
            free = speed + STEP * (force - bristled * bristles - viscous * speed) / mass
            held = STEP * curve * ~bristled / mass
            speed = np.sign(free) * np.maximum(np.abs(free) - held, 0.0)
            position = position + STEP * speed
    made: list[Record] = []
    for place, (number, each) in enumerate(zip(numbers, axes, strict=True)):
        random = np.random.default_rng((73, number))
        noise = FORCE_NOISE * np.std(forces[:, place])
        force = forces[:, place] + noise * random.standard_normal(len(forces))
        reference = references[:, place] if each.reference else None
        still = np.zeros(len(forces))
        made.append(Record(f"axis {number}", period, seen[:, place], still, force, None, reference))
    return made


def judged(number: int, found: Findings) -> dict[str, Any]:
    """Return how many points of the curves were driven, are said to be known, and are inside."""
    record = found.records[0]
    true, speeds = axis(number), np.abs(record.smoothed(1))
    slowest, fastest = np.quantile(speeds, [0.05, 0.99])
    driven = known = inside = 0
    worst = 0.0
    for curve in found.curves:
        rows = (curve.speed > max(slowest, 1e-3)) & (curve.speed < fastest)
        half, force = QUANTILE * curve.standard_error[rows], curve.force[rows]
        off = np.abs(force - true.friction(curve.speed[rows]))
        told = half < 0.5 * np.abs(force)
        driven += len(off)
        known += int(np.count_nonzero(told))
        inside += int(np.count_nonzero(told & (off <= half)))
        worst = max(worst, float(np.max((off / true.friction(curve.speed[rows]))[told], initial=0)))
    error = found.check(record)["free_run_error"]
    assert error is not None
    mass = found.fitted["mass"]
    return {
        "law": found.law,
        "mass": (mass.value - true.mass) / mass.standard_error,
        "driven": driven,
        "known": known,
        "inside": inside,
        "worst": worst,
        "free_run": error / float(np.std(record.position)),
        "warned": any("free run" in note for note in notes(found)),
        "notes": [*notes(found)],
    }


def summary(numbers: Sequence[int], law: str = "auto") -> dict[str, Any]:
    """Return the counts over some axes."""
    made, cases = records(tuple(numbers)), list[dict[str, Any]]()
    for number in numbers:
        begun = process_time()
        case = judged(number, identify([made[number]], law))
        cases.append({"number": number, **case, "seconds": process_time() - begun})
        print(cases[-1], flush=True)
    counts = {name: sum(case[name] for case in cases) for name in ("driven", "known", "inside")}
    silent = [c["number"] for c in cases if c["free_run"] > FAR and not c["warned"]]
    return {"cases": cases, **counts, "share": counts["inside"] / counts["known"], "silent": silent}


def main() -> None:
    """Run the study, and write its counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--axes", type=int, nargs="*", default=range(AXES))
    parser.add_argument("--law", default="auto")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    found = summary(arguments.axes, arguments.law)
    print({name: value for name, value in found.items() if name != "cases"})
    if arguments.out is not None:
        text = json.dumps({**found, "versions": versions()}, indent=1)
        arguments.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
