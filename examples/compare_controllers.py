"""No control, PD-style velocity feedback and the washout at three belt speeds, in lockstep.

Runs each controller as a ROS 2 node against the plant, for 3 s. Writes comparison.json and
compare_controllers.png; docs/controllers.md shows the values as a table.
"""

import json
import sys
from pathlib import Path

from matplotlib.figure import Figure
from velocity_feedback import VelocityFeedback

from stickslip_ros.testing import ClosedLoop, RunResult

BELT_SPEEDS = (0.01, 0.02, 0.04)  # m/s
DURATION = 3.0  # s
CONTROLLERS = {"no control": None, "velocity feedback": VelocityFeedback, "washout": "washout"}
LOOKS = {
    "no control": {"color": "0.6", "lw": 0.8},
    "velocity feedback": {"color": "C1", "ls": "--", "lw": 1.2},
    "washout": {"color": "C0", "lw": 1.6},
}
SHOWN = 0.6  # s, from the start
WASHOUT = ("washout_controller.linear_gain=-6000.0", "washout_controller.start_after=0.0")


def run(belt_speed: float, controller: str) -> RunResult:
    """Run the feed drive at a belt speed (m/s) with one of CONTROLLERS."""
    chosen = CONTROLLERS[controller]
    gains = () if chosen is None else WASHOUT
    overrides = (f"plant.belt_speed={belt_speed}", *gains)
    with ClosedLoop("feed_drive", *overrides, controller=chosen) as loop:
        return loop.run(DURATION)


def figures(belt_speed: float, controller: str, result: RunResult) -> dict[str, object]:
    """Return the values of a run, in SI units."""
    return {
        "belt_speed": belt_speed,
        "controller": controller,
        "regime": result.measures.regime,
        "amplitude": result.measures.amplitude,
        "midpoint": result.measures.midpoint,
        "peak_force": result.peak_force,
        "resting_force": result.resting_force,
    }


def draw(results: list[tuple[tuple[float, str], RunResult]]) -> Figure:
    """Return displacement and force over time, a column for each belt speed."""
    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    panels = figure.subplots(2, len(BELT_SPEEDS), sharex=True, sharey="row")
    for (belt_speed, controller), result in results:
        position, force = panels[:, BELT_SPEEDS.index(belt_speed)]
        look = {**LOOKS[controller], "label": controller}
        start = result.states.stamp[0]
        time, answered = (1e-9 * (each.stamp - start) for each in (result.states, result.forces))
        position.plot(time, 1e6 * result.states.position, **look)
        force.step(answered, result.forces.force, where="post", **look)
        position.set(title=f"belt speed {1e3 * belt_speed:g} mm/s", xlim=(0.0, SHOWN))
        force.set_xlabel("time (s)")
    panels[0, 0].set_ylabel("displacement (µm)")
    panels[1, 0].set_ylabel("control force (N)")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def main(folder: Path) -> None:
    """Run every controller at every belt speed."""
    cases = [(speed, controller) for speed in BELT_SPEEDS for controller in CONTROLLERS]
    results = [(case, run(*case)) for case in cases]
    rows = [figures(*case, result) for case, result in results]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "comparison.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    draw(results).savefig(folder / "compare_controllers.png", dpi=130)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build"))
