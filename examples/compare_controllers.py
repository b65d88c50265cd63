"""No control, PD-style velocity feedback and the washout at three belt speeds, in lockstep.

Runs each controller as a ROS 2 node against the plant, for 3 s. Writes comparison.json and
compare_controllers.png; docs/controllers.md shows the values as a table.
"""

import json
import sys
from pathlib import Path

from velocity_feedback import VelocityFeedback

from stickslip_ros.plots.controller_comparison import ControlledRun, comparison_figure
from stickslip_ros.plots.style import save
from stickslip_ros.testing import ClosedLoop, RunResult

BELT_SPEEDS = (0.01, 0.02, 0.04)  # m/s
DURATION = 3.0  # s
CONTROLLERS = {"no control": None, "velocity feedback": VelocityFeedback, "washout": "washout"}
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


def main(folder: Path) -> None:
    """Run every controller at every belt speed."""
    cases = [(speed, controller) for speed in BELT_SPEEDS for controller in CONTROLLERS]
    results = [(case, run(*case)) for case in cases]
    rows = [figures(*case, result) for case, result in results]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "comparison.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    runs = [ControlledRun(*case, result.states, result.forces) for case, result in results]
    save(comparison_figure(runs), folder / "compare_controllers.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build"))
