"""No control, PD-style velocity feedback and the washout at three belt speeds.

Writes comparison.json and comparison.png beside this file, and the table into ../controllers.md.
"""

import json
import re
from pathlib import Path

from velocity_feedback import VelocityFeedback

from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.plots.controller_comparison import ControlledRun, comparison_figure
from stickslip_ros.plots.style import save
from stickslip_ros.testing import ClosedLoop, RunResult

HERE = Path(__file__).parent
PAGE = HERE.parent / "controllers.md"

BELT_SPEEDS = (0.01, 0.02, 0.04)
DURATION = 3.0
CONTROLLERS = {"no control": None, "velocity feedback": VelocityFeedback, "washout": "washout"}
WASHOUT = ("washout_controller.linear_gain=-6000.0", "washout_controller.start_after=0.0")

BEGIN, END = "<!-- table of compare.py -->\n", "<!-- end of the table -->\n"
HEAD = (
    "| belt speed, mm/s | control | regime | amplitude, µm | rests at, µm | peak force, N "
    "| force at rest, N |\n|---|---|---|---|---|---|---|\n"
)


def run(belt_speed: float, controller: str) -> RunResult:
    """Run the feed drive at a belt speed (m/s) with one of CONTROLLERS."""
    overrides = (f"plant.belt_speed={belt_speed}", *WASHOUT)
    with ClosedLoop("feed_drive", *overrides, controller=CONTROLLERS[controller]) as loop:
        return loop.run(DURATION)


def figures(belt_speed: float, controller: str, result: RunResult) -> dict[str, object]:
    """Return what is told of a run, in SI units."""
    return {
        "belt_speed": belt_speed,
        "controller": controller,
        "regime": result.measures.regime,
        "amplitude": result.measures.amplitude,
        "midpoint": result.measures.midpoint,
        "peak_force": result.peak_force,
        "resting_force": result.resting_force,
    }


def table(rows: list[dict]) -> str:
    """Return the figures of several runs as a table of the page."""
    lines = [
        f"| {row['belt_speed'] * 1e3:g} | {row['controller']} | {Regime.label(row['regime'])} "
        f"| {row['amplitude'] * 1e6:.1f} "
        f"| {_number(row['midpoint'] * 1e6 if row['regime'] == 'equilibrium' else None)} "
        f"| {_number(row['peak_force'])} | {_number(row['resting_force'])} |\n"
        for row in rows
    ]
    return HEAD + "".join(lines)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"


def main() -> None:
    """Compute all of it and write it down."""
    results = {
        (speed, controller): run(speed, controller)
        for speed in BELT_SPEEDS
        for controller in CONTROLLERS
    }
    rows = [figures(*case, result) for case, result in results.items()]
    (HERE / "comparison.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    runs = [ControlledRun(*case, r.states, r.forces) for case, r in results.items()]
    save(comparison_figure(runs), HERE / "comparison.png")
    page = PAGE.read_text(encoding="utf-8")
    new = BEGIN + table(rows) + END
    PAGE.write_text(re.sub(f"{BEGIN}.*{END}", lambda _: new, page, flags=re.S), encoding="utf-8")


if __name__ == "__main__":
    main()
