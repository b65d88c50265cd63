"""Does a report tell how a creeping axis moves?

Axes of random mass, stiffness, friction and feed, four of six of which stick and slip, one slides
unevenly without standing still and one evenly, as a drive records them: encoder, command, and the
velocity through a filter. Each is reported in three readings: the position alone; the command less
the position, with the feed as belt speed; the position with the velocity of the drive.

A report is right if its regime is, its period is within 2 %, its amplitude within 5 % or a step,
and its stick fraction within 0.03, two samples or three of its standard errors. It is told if what
is not right is null, or has an error above 0.1 of a stick fraction or a fifth of another value, or
if the motion is undersampled. Else it is wrong.
"""

import argparse
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import stickslip_ros as ss
from stickslip_ros.installed_packages import versions
from stickslip_ros.record.report import report_of_recording

READINGS = ("position", "command less position", "position and velocity")
KINDS = ("sticks", "sticks", "sticks", "sticks", "uneven", "even")
AXES = 120
LEAST_RIGHT = 0.92
_RATES = (100.0, 250.0, 500.0, 1000.0, 2000.0)
_CYCLES, _LONGEST, _LEAST_STICK = 8, 40.0, 0.04


@dataclass(frozen=True)
class Axis:
    """What a drive records of an axis, and how it moves; SI units."""

    kind: str
    feed: float
    rate: float
    step: float
    noise: float
    position: np.ndarray
    velocity: np.ndarray
    regime: tuple[str, ...]
    period: float
    amplitude: float
    stick_fraction: float


def axis(seed: int) -> Axis:
    """Return an axis by its number."""
    random, kind = np.random.default_rng([seed, 68]), KINDS[seed % len(KINDS)]
    while True:
        rate, frequency = float(random.choice(_RATES)), 10.0 ** random.uniform(0.4, 1.5)
        if rate < 16.0 * frequency:
            continue
        if kind == "sticks":
            found = _creeping(random, rate, frequency)
            if found is None:
                continue
            position, feed, measures = found
            regime: tuple[str, ...] = ("stick_slip",)
            period, size = measures.period, 2.0 * measures.amplitude
            stick = measures.stick_fraction
        else:
            feed, stick, period = 10.0 ** random.uniform(-3.3, -1.5), 0.0, 1.0 / frequency
            time = np.arange(round(float(np.clip(14.0 * period, 4.0, 20.0)) * rate)) / rate
            share = random.uniform(0.2, 0.93) if kind == "uneven" else 0.0
            size = (share or 1.0) * feed * period / np.pi
            swing = size / 2.0 * bool(share)
            position = feed * time + swing * np.sin(2.0 * np.pi * time / period)
            regime = ("pure_slip",) if share else ("equilibrium", "held")
        break
    steps = 10.0 ** random.uniform(1.5, 3.5)  # in a swing
    step = size / steps
    noise = step * float(random.choice([0.0, 0.0, 0.3, 1.0])) if steps > 100.0 else 0.0
    told = position + random.uniform(0.0, step) + noise * random.standard_normal(len(position))
    told = np.round(told / step) * step
    share = 1.0 / (1.0 + float(random.choice([0.002, 0.005])) * rate)
    velocity, last = np.empty(len(told)), 0.0
    for row, change in enumerate(np.diff(told, prepend=told[0]) * rate):
        last += share * (float(change) - last)
        velocity[row] = last
    noisy = kind, feed, rate, step, noise, told, velocity
    return Axis(*noisy, regime, period, size / 2.0, stick)


def _creeping(
    random: np.random.Generator, rate: float, frequency: float
) -> tuple[np.ndarray, float, Any] | None:
    """Return positions, feed and measures of a slide that sticks and slips; None for another."""
    mass, omega = random.uniform(20.0, 400.0), 2.0 * np.pi * frequency
    static = random.uniform(0.1, 0.35)
    kinetic = static * random.uniform(0.4, 0.85)
    fall = (static - kinetic) * 9.81 / omega  # speed of a slip, m/s
    feed = fall * 10.0 ** random.uniform(-1.7, -0.1)
    cycle = 2.0 * fall / (omega * feed) + 1.0 / frequency
    if _CYCLES * cycle > _LONGEST:
        return None
    drive = ss.scenario(
        "feed_drive",
        mass=mass,
        stiffness=mass * omega**2,
        damping=2.0 * mass * omega * random.uniform(0.01, 0.15),
        normal_force=9.81 * mass,
        belt_speed=feed,
        friction_law="exponential",
        friction_static=static,
        friction_kinetic=kinetic,
        friction_decay_speed=10.0 ** random.uniform(-3.5, -1.5),
        friction_exponent=float(random.choice([1.0, 2.0])),
        rate=rate,
        start_after=1e6,
    )
    run = ss.simulate(drive, duration=float(np.clip((_CYCLES + 6) * cycle, 6.0, 60.0)))
    measures = run.measures
    sticks = measures.regime == "stick_slip" and (measures.stick_fraction or 0.0) >= _LEAST_STICK
    if not sticks or measures.steady is not True:
        return None
    seen = np.array(run.trajectory.position)[-round(max(_CYCLES * cycle, 4.0) * rate) :]
    return feed * np.arange(len(seen)) / rate - seen, feed, measures


def verdict(report: dict[str, Any], true: Axis) -> str:
    """Return right, told, or wrong with what is."""
    regime, stick = report["regime"], report["stick_fraction"]
    if true.kind == "even":
        if regime in (None, "undersampled"):
            return "told"
        return "right" if regime in true.regime and (stick or 0.0) <= 0.03 else f"wrong: {regime}"
    errors: dict[str, float] = report["errors"] or {}
    shares = 3.0 * errors.get("stick_fraction", 0.0), 2.0 / (true.rate * true.period)
    limits = {
        "period": 0.02 * true.period,
        "amplitude": max(0.05 * true.amplitude, true.step),
        "stick_fraction": max(0.03, *shares),
    }
    off = {
        name: report[name] is None or abs(report[name] - getattr(true, name)) > limit
        for name, limit in limits.items()
    }
    off["regime"] = regime not in true.regime
    false = [name for name, is_off in off.items() if is_off and report[name] is not None]
    if false:
        return f"wrong: {', '.join(false)}"
    wide = errors.get("stick_fraction", 0.0) > 0.1 or any(
        errors.get(name, 0.0) > 0.2 * (report[name] or 0.0) for name in ("period", "amplitude")
    )
    return "told" if wide or any(off.values()) else "right"


def reported(seed: int, readings: Sequence[str] = READINGS) -> dict[str, str]:
    """Return the verdict on each reading of an axis."""
    true, verdicts = axis(seed), dict[str, str]()
    time = np.arange(len(true.position)) / true.rate
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "axis.csv"
        table = np.column_stack([time, true.position, true.feed * time, true.velocity])
        np.savetxt(path, table, "%.10g", ",", header="t,x,cmd,v", comments="")
        for reading in readings:
            columns, belt = {"time": "t", "position": "x"}, None
            if reading == READINGS[1]:
                columns["position"], belt = "cmd-x", float(f"{true.feed:.9g}")
            elif reading == READINGS[2]:
                columns["velocity"] = "v"
            report = report_of_recording(path, columns, belt_speed=belt)
            verdicts[reading] = verdict(report, true)
    return verdicts


def study(axes: Sequence[int], workers: int | None) -> dict[str, Any]:
    """Return how many reports of axes are right, told and wrong, by reading, and which are not."""
    with ProcessPoolExecutor(workers) as pool:
        found = dict(zip(axes, pool.map(partial(reported), axes), strict=True))
    counts = {
        reading: dict(Counter(each[reading].split(":")[0] for each in found.values()))
        for reading in READINGS
    }
    others = {
        f"{number} ({KINDS[number % len(KINDS)]}), {reading}": each[reading]
        for number, each in found.items()
        for reading in READINGS
        if each[reading] != "right"
    }
    return {"axes": len(axes), "counts": counts, "others": others, "versions": versions()}


def shortfalls(found: dict[str, Any]) -> list[str]:
    """Return where reports are worse than they are to be, as sentences."""
    said = [f"{axis}: {what}" for axis, what in found["others"].items() if "wrong" in what]
    for reading, counts in found["counts"].items():
        if counts.get("right", 0) < LEAST_RIGHT * found["axes"]:
            said.append(f"{reading}: {counts} of {found['axes']}")
    return said


def main() -> int:
    """Run the study; return 1 if the reports are worse than they are to be."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.creeping_axes",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--axes", type=int, default=AXES, help=f"default: {AXES}")
    parser.add_argument("--first", type=int, default=0, help="number of the first; default: 0")
    parser.add_argument("--workers", type=int, default=None, help="processes")
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write JSON to this file")
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.axes)
    found = study(numbers, arguments.workers)
    print(json.dumps({name: found[name] for name in ("counts", "others")}, indent=2))
    if arguments.out is not None:
        arguments.out.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return 1 if shortfalls(found) else 0


if __name__ == "__main__":
    sys.exit(main())
