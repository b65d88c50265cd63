"""Drawing the paper's figures: bifurcation diagrams and phase portraits."""

from collections.abc import Mapping
from itertools import cycle
from math import ceil
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from stickslip_ros.arrays import FloatArray
from stickslip_ros.paper.figures import BifurcationFigure, Panel, PaperFigure, PortraitFigure
from stickslip_ros.paper.portraits import LAST_CYCLES, Portrait
from stickslip_ros.physics.measures.breakpoints import Breakpoints
from stickslip_ros.plots.regimes import REGIMES
from stickslip_ros.plots.style import BLUE, DASHES, GREEN, ORANGE, save, styled

_FIRST, _LATER, _BELT = "#888888", "#DDDDDD", "black"

_FIRST_PERIODS = 20
"""Natural periods from rest that are emphasized; more of them would merge."""

_FRAME = 10.0
"""Speed, in belt speeds, at which a diverging motion leaves the frame."""


def draw_paper_figure(
    path: Path, figure: PaperFigure, marks: Mapping[str, float] | None = None
) -> None:
    """Write the figure to `path`; the format follows the ending.

    `marks` are vertical lines in a bifurcation diagram: the values of the parameter, by a name such
    as that of a Hopf point.
    """
    if isinstance(figure, BifurcationFigure):
        drawn = _bifurcation(figure, marks or {})
    else:
        drawn = _portraits(figure)
    save(drawn, path, colours=128)  # these figures are kept with the sources


@styled
def _bifurcation(figure: BifurcationFigure, marks: Mapping[str, float]) -> Figure:
    drawn = Figure(figsize=(8.0, 5.5))
    drawn.suptitle(fill(figure.title, 95), fontsize=11)
    above, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3.0, 1.0))
    diagram = figure.diagram
    regimes = [measures.regime for measures in diagram.measures]
    for regime, look in REGIMES.items():
        of_regime = np.array([found is regime for found in regimes])
        rows = of_regime[diagram.row]
        if rows.any():
            values = figure.values[diagram.row[rows]]
            above.plot(
                values, diagram.position[rows], look.marker, color=look.colour, ms=1.8, mew=0.0,
                label=look.label,
            )  # fmt: skip
    above.set_ylabel("turning points of X")
    stick = [np.nan if m.stick_fraction is None else m.stick_fraction for m in diagram.measures]
    below.plot(figure.values, stick, color=ORANGE, lw=1.5)
    below.set_ylabel("stick fraction")
    below.set_ylim(bottom=0.0)
    below.set_xlabel(figure.parameter)
    below.margins(x=0.01)
    for (name, value), dashes in zip(marks.items(), cycle(DASHES)):
        for axes in (above, below):
            axes.axvline(value, color="black", lw=1.0, ls=dashes, label=f"{name} {value:.5g}")
    above.legend(fontsize=8, markerscale=4.0)
    return drawn


@styled
def _portraits(figure: PortraitFigure) -> Figure:
    largest = max(len(panel.portraits) for panel in figure.panels)
    columns = largest if largest <= 5 else 4
    rows = [ceil(len(panel.portraits) / columns) for panel in figure.panels]
    heights = [*(2.5 * count + 0.3 for count in rows), 0.3]
    drawn = Figure(figsize=(2.5 * columns, sum(heights) + 0.3))
    drawn.suptitle(figure.title, fontsize=12)
    parts = drawn.add_gridspec(len(heights), 1, height_ratios=heights)
    for number, (panel, count) in enumerate(zip(figure.panels, rows, strict=True)):
        _panel(drawn.add_subfigure(parts[number, 0]), panel, count, columns)
    handles = [
        Line2D([], [], color=_FIRST, lw=1.0, label=f"first {_FIRST_PERIODS} periods"),
        Line2D([], [], color=_LATER, lw=4.0, label="later"),
        Line2D([], [], color=BLUE, lw=2.0, label=f"last {LAST_CYCLES} cycles"),
        Line2D([], [], color=_BELT, lw=0.8, ls="--", label="belt speed"),
        Line2D([], [], color=GREEN, ls="", marker="o", ms=5.0, label="equilibrium"),
    ]
    if any(portrait.measures.stick_fraction for portrait in figure.portraits):
        handles.insert(3, Line2D([], [], color=ORANGE, lw=4.0, label="sticking"))
    legend = drawn.add_subfigure(parts[-1, 0])
    legend.legend(handles=handles, loc="center", ncols=len(handles), fontsize=9, frameon=False)
    return drawn


def _panel(subfigure: SubFigure, panel: Panel, rows: int, columns: int) -> None:
    subfigure.suptitle(panel.title, fontsize=10, fontweight="bold")
    bounded = [portrait for portrait in panel.portraits if not portrait.runs_away]
    # A diverging motion gets a frame of its own: in a common one the others would be too small.
    share = len(bounded) == len(panel.portraits)
    grid = subfigure.subplots(rows, columns, sharex=share, sharey=share, squeeze=False)
    belt_speeds = np.array([portrait.drive.belt_speed for portrait in panel.portraits])
    for axes in grid.flat[len(panel.portraits) :]:
        axes.set_visible(False)
    for number, (axes, portrait) in enumerate(zip(grid.flat, panel.portraits, strict=False)):
        _portrait(axes, portrait)
        shown = [_framed(other) for other in ([portrait] if portrait.runs_away else bounded)]
        axes.set_xlim(_range(*(breakpoints.position for breakpoints in shown)))
        axes.set_ylim(_range(*(breakpoints.velocity for breakpoints in shown), belt_speeds))
        if number % columns == 0:
            axes.set_ylabel("dX/dτ")
        if number + columns >= len(panel.portraits):
            axes.set_xlabel("X")
            axes.tick_params(labelbottom=True)


def _portrait(axes: Axes, portrait: Portrait) -> None:
    last, measures, belt_speed = portrait.last_cycles, portrait.measures, portrait.drive.belt_speed
    whole = _framed(portrait)
    first = whole[whole.time <= _FIRST_PERIODS * portrait.drive.natural_period]
    axes.plot(whole.position, whole.velocity, color=_LATER, lw=0.8)
    axes.plot(first.position, first.velocity, color=_FIRST, lw=0.5)
    axes.axhline(belt_speed, color=_BELT, lw=0.8, ls="--")
    if measures.period is not None:
        axes.plot(last.position, last.velocity, color=BLUE, lw=1.6)
        stuck = np.where(last.stuck, last.position, np.nan)
        axes.plot(stuck, np.full(len(last), belt_speed), color=ORANGE, lw=3.0)
    axes.plot(portrait.drive.equilibrium_position, 0.0, "o", color=GREEN, ms=4.0)
    axes.set_title(f"{portrait.case.label}\n{_outcome(portrait)}", fontsize=8)
    axes.tick_params(labelsize=7)


def _framed(portrait: Portrait) -> Breakpoints:
    """Return the trajectory; that of a diverging motion ends where it leaves the frame."""
    trajectory = portrait.trajectory
    if not portrait.runs_away:
        return trajectory
    beyond = np.abs(trajectory.velocity) > _FRAME * abs(portrait.drive.belt_speed)
    return trajectory[: int(np.argmax(beyond))]


def _outcome(portrait: Portrait) -> str:
    measures = portrait.measures
    outcome = REGIMES[measures.regime].label
    if portrait.runs_away:
        time = portrait.time_beyond(_FRAME * abs(portrait.drive.belt_speed))
        return f"{outcome}: {_FRAME:g} v0 at τ = {time:.1f}"
    if measures.period is None or measures.amplitude is None:
        return outcome
    if measures.stick_fraction:
        outcome = f"sticks {measures.stick_fraction:.1%}"
    if portrait.settling_time is None:
        outcome = "still settling"
    return f"{outcome}, amplitude {measures.amplitude:#.3g}"


def _range(*columns: FloatArray) -> tuple[float, float]:
    """Return limits with a margin around all values."""
    lowest = min(float(column.min()) for column in columns)
    highest = max(float(column.max()) for column in columns)
    room = 0.06 * (highest - lowest)
    return lowest - room, highest + room
