"""Figure of a recorded run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from stickslip_ros.physics.measures.cycle_measures import measures_of
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.plots.run_figure import run_figure
from stickslip_ros.plots.run_history import RunHistory
from stickslip_ros.plots.style import SCREEN, FigureStyle


def recorded_run_figure(
    bag: Path,
    drive: Drive | None,
    history: RunHistory,
    report: Mapping[str, Any],
    *,
    style: FigureStyle = SCREEN,
) -> Figure:
    """Return the figure of a recorded run, with what the `report` of its bag notes.

    `drive` is None if the bag does not hold its parameters.
    """
    notes = [*report["missing"], *report["notes"]]
    if drive is None:
        notes.append("it is not recorded what drive it was: no equilibrium, no friction law")
    title = f"Recorded run, {bag}"
    return run_figure(history, measures_of(report), drive, title=title, notes=notes, style=style)
