"""What is left of the washout behind a motor: the linear sampled loop against simulation.

`python -m benchmarks.behind_the_screw --out FILE.json` follows a small deviation from the
equilibrium of 300 drives: the slide of `feed_drive` behind a motor of 0.1, 1 and 10 times its mass,
with cascades of ten bandwidths w on the motor, Kp = (m + M) w, Kv = w/4, Ki = Kp w/4, and a washout
of five gains on the velocity of table or motor. It names the points at which theory and simulation
contradict each other, and draws `--figure FILE.png` (docs/behind-the-screw.md).
"""

import argparse
import json
import sys
from dataclasses import replace
from itertools import product
from math import inf, log
from pathlib import Path
from typing import Any

import numpy as np

from stickslip_ros.installed_packages import versions
from stickslip_ros.model.control import Cascade
from stickslip_ros.model.motor import Motor
from stickslip_ros.motion import Motion
from stickslip_ros.motion.controller import Controller, answer
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop

RATE = 1000.0
RATIOS = (0.1, 1.0, 10.0)
BANDWIDTHS = np.geomspace(4.0, 200.0, 10)
GAINS = (0.0, -1500.0, -3000.0, -6000.0, -12000.0)
PLACES = ("table", "motor")
DEVIATION = 1e-4
LONGEST = 60.0


def point(ratio: float, bandwidth: float, gain: float, place: str) -> dict[str, Any]:
    """Return the rate of decay by theory, and what a small deviation does in simulation."""
    slide = load_scenario("feed_drive").plant.as_drive()
    drive = replace(slide, motor=Motor(mass=ratio * slide.mass))
    kp = (1.0 + ratio) * slide.mass * bandwidth
    law = Cascade(
        bandwidth / 4.0, kp, kp * bandwidth / 4.0, corner_frequency=20.0, linear_gain=gain,
        feedback="motor", velocity_feedback="motor", washout_feedback=place,
    )  # fmt: skip
    loop = LinearSampledLoop.from_drive(drive, RATE)
    assert loop is not None
    rate = loop.decay_rate(law)
    return {
        "ratio": ratio, "bandwidth": float(bandwidth), "gain": gain, "place": place,
        "decay_rate": rate, "simulated_rate": simulated_rate(drive, law, rate),
    }  # fmt: skip


def simulated_rate(drive: Any, law: Cascade, expected: float) -> float:
    """Return the mean rate at which the deviation decays, until it has changed e^5-fold."""
    expansion = expand(drive, law)
    assert expansion is not None
    rest = expansion.equilibrium
    x, far = rest[0] * drive.length_scale, rest[-2] * drive.length_scale
    motion = Motion(drive, 0.0, 0.0)
    motion.restart(x * (1.0 + DEVIATION), 0.0, motor=(far, 0.0))
    loop = SampledLoop(motion, RATE, LOCKSTEP_START)
    controller = Controller(law, state=(float(rest[2]) * drive.normal_force, 0.0, 0.0, 0.0))

    def size(duration: float) -> float:
        """Return the largest deviation over a duration, in natural units."""
        largest = 0.0
        for _ in range(round(duration * RATE)):
            answer(loop, controller)
            sample = loop.advance()
            own = abs(sample.position - x), abs(sample.velocity) / drive.angular_frequency
            largest = max(largest, *own)
        return largest

    window = min(max(1.0 / abs(expected), 0.1), 1.0)
    size(window)  # the other modes decay
    first = last = size(window)
    if motion.unbounded or first == 0.0:
        return -inf if motion.unbounded else inf
    now = 0.0
    while now < LONGEST and abs(log(last / first)) < 5.0 and not motion.unbounded:
        last = max(size(window), 1e-12 * first)
        now += window
    return -log(last / first) / now


def figure(points: list[dict[str, Any]], path: Path) -> None:
    """Draw where the loop holds, by theory, and with a ring where simulation does."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.lines import Line2D

    shown, axes = plt.subplots(2, 3, figsize=(10, 5.4), sharex=True, sharey=True)
    for (row, place), (column, ratio) in product(enumerate(PLACES), enumerate(RATIOS)):
        ax = axes[row, column]
        for each in points:
            if (each["place"], each["ratio"]) != (place, ratio):
                continue
            at = each["bandwidth"], GAINS.index(each["gain"])
            holds = each["decay_rate"] > 0.0
            ax.plot(*at, "s", ms=11, color="#4c9f70" if holds else "#d9d9d9")
            if each["simulated_rate"] > 0.0:
                ax.plot(*at, "o", ms=5, mfc="none", mec="black")
        ax.set(xscale="log", title=rf"washout on {place}, $M = {ratio:g}\,m$")
        ax.set_yticks(range(len(GAINS)), [f"{abs(gain) / 1e3:g}" for gain in GAINS])
        if row == 1:
            ax.set_xlabel("bandwidth of the cascade, rad/s")
        if column == 0:
            ax.set_ylabel("$-k_1$, kN s/m")
    square: dict[str, Any] = {"marker": "s", "ls": "", "ms": 11}
    handles = [
        Line2D([], [], **square, color="#4c9f70", label="holds, by the linear sampled loop"),
        Line2D([], [], **square, color="#d9d9d9", label="does not"),
        Line2D([], [], marker="o", ls="", ms=5, mfc="none", mec="black", label="simulated: holds"),
    ]
    shown.tight_layout(rect=(0.0, 0.07, 1.0, 1.0))
    shown.legend(handles=handles, loc="lower center", ncols=3)
    shown.savefig(path, dpi=110)


def main() -> int:
    """Compute the map; return 1 if theory and simulation contradict each other."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.behind_the_screw")
    parser.add_argument("--out", type=Path, metavar="FILE")
    parser.add_argument("--figure", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    points = [point(*each) for each in product(RATIOS, BANDWIDTHS, GAINS, PLACES)]
    contrary = [each for each in points if each["decay_rate"] * each["simulated_rate"] <= 0.0]
    for each in contrary:
        print(f"contradiction: {each}")
    print(f"{len(points)} points, {len(contrary)} contradictions")
    for ratio, place in product(RATIOS, PLACES):
        own = [p for p in points if (p["ratio"], p["place"]) == (ratio, place)]
        held = [sum(p["decay_rate"] > 0 for p in own if p["gain"] == gain) for gain in GAINS]
        print(f"motor {ratio:g} m, washout on {place}: held at {held} of {len(BANDWIDTHS)}")
    if arguments.out is not None:
        found = {"points": points, "versions": versions()}
        arguments.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if arguments.figure is not None:
        figure(points, arguments.figure)
    return int(bool(contrary))


if __name__ == "__main__":
    sys.exit(main())
