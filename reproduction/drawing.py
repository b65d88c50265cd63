"""Drawing the paper's figures: bifurcation diagrams and phase portraits."""

import re
from io import BytesIO
from math import ceil
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from PIL import Image

from reproduction.figures import (
    LAST_CYCLES,
    BifurcationFigure,
    Panel,
    PaperFigure,
    Portrait,
    PortraitFigure,
)
from stickslip_ros.files import written
from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.show import BLUE, GREEN, ORANGE
from stickslip_ros.show.quantities import GREEK, Units
from stickslip_ros.show.regimes import REGIMES
from stickslip_ros.show.study_figure import draw_section, draw_transitions, regime_handles
from stickslip_ros.show.style import SCREEN, FigureStyle, finish, rendered, save, styled
from stickslip_ros.studies.transitions import transition_label

_FIRST_COLOUR, _LATER_COLOUR, _BELT_COLOUR = "#888888", "#DDDDDD", "black"

_FIRST_PERIODS = 20
"""Natural periods from rest that are emphasized; more of them would merge."""

_FRAME = 10.0
"""Speed, in belt speeds, at which a diverging motion leaves the frame."""

_LEAST_STICK_FRACTION = 0.1
"""Upper end of its axis, at least."""

_KEPT_DOTS, _KEPT_COLOURS = 110.0, 128
"""Dots per inch and colours of the figures for the screen, which are kept with the sources."""

_LINE_LENGTH = 44
"""Letters in a line of a column in print."""

_UNITS = Units(dimensionless=True, terse=True)

_SYMBOL = re.compile(r"(?<![A-Za-z])(?:([vkμ])([0-9sm])|([dβγτ]|X'))(?![A-Za-z])")
"""A symbol in plain text: with an index, or without."""


def paper_figure(figure: PaperFigure, *, style: FigureStyle = SCREEN) -> Figure:
    """Return the drawing of a figure; a bifurcation diagram has what theory tells, too."""
    if isinstance(figure, BifurcationFigure):
        return _bifurcation(figure, style=style)
    return _portraits(figure, style=style)


def save_paper_figure(drawn: Figure, path: Path, style: FigureStyle = SCREEN) -> None:
    """Write a drawing to `path`; the format follows the ending."""
    if style.printed or path.suffix != ".png":
        save(drawn, path, dots_per_inch=style.dots_per_inch if style.printed else _KEPT_DOTS)
        return
    with Image.open(BytesIO(rendered(drawn, "png", _KEPT_DOTS))) as image:
        # This method, unlike the usual one, keeps colours that few points have.
        few = image.convert("RGB").quantize(_KEPT_COLOURS, Image.Quantize.MAXCOVERAGE)
    smaller = BytesIO()
    few.save(smaller, format="png", optimize=True)
    with written(path, replace=True) as stream:
        stream.buffer.write(smaller.getvalue())


def typeset(text: str) -> str:
    """Return a plain text, such as "belt speed v0", with its symbols as formulas."""

    def formula(found: re.Match[str]) -> str:
        letter, index, alone = found.groups()
        symbol = f"{GREEK.get(letter, letter)}_{index}" if index else GREEK.get(alone, alone)
        return f"${symbol}$"

    return _SYMBOL.sub(formula, text)


@styled
def _bifurcation(figure: BifurcationFigure, *, style: FigureStyle) -> Figure:
    drawn = style.figure(8.0, 5.5, narrow=1.25)
    style.set_title(drawn, *figure.title.split(": "))
    above, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3.0, 1.0))
    columns = figure.columns
    draw_section(above, figure.values, columns.regime, columns.turning_points)
    handles = regime_handles(columns.regime)
    unstable = figure.unstable_equilibria
    if np.isfinite(unstable).any():
        dashed: Any = {"color": GREEN, "lw": 1.2, "ls": (0, (4.0, 2.0))}
        above.plot(figure.values, unstable, **dashed)
        handles.append(Line2D([], [], **dashed, label="unstable equilibrium"))
    above.set_ylabel(_UNITS.named("turning points"))
    stick = columns.stick_fraction
    below.plot(figure.values, stick, color=ORANGE, lw=1.5)
    below.set_ylabel("stick fraction")
    below.set_ylim(0.0, max(1.05 * float(np.nanmax(stick, initial=0.0)), _LEAST_STICK_FRACTION))
    below.set_xlabel(typeset(figure.plan.label))
    below.margins(x=0.01)
    marks = {transition_label(name): [value] for name, value in figure.transitions.items()}
    handles += draw_transitions((above, below), marks, lambda values: f"{values[0]:.5g}")
    style.legend_below(drawn, handles)
    finish(drawn)
    return drawn


@styled
def _portraits(figure: PortraitFigure, *, style: FigureStyle) -> Figure:
    largest = max(len(panel.portraits) for panel in figure.panels)
    columns = largest if largest <= 5 else 4
    width, height = 2.5, 2.8
    if style.width is not None:
        columns = min(columns, 3 if style.narrow else 5)
        width = style.width / columns
        height = width + 0.5
    rows = [ceil(len(panel.portraits) / columns) for panel in figure.panels]
    heights = [height * count + 0.3 for count in rows]
    drawn = Figure(figsize=(width * columns, sum(heights) + 0.6))
    style.set_title(drawn, *figure.title.split(": "))
    parts = drawn.add_gridspec(len(heights), 1, height_ratios=heights)
    for number, (panel, count) in enumerate(zip(figure.panels, rows, strict=True)):
        _panel(drawn.add_subfigure(parts[number, 0]), panel, count, columns, style)
    handles: list[Artist] = [
        Line2D([], [], color=_FIRST_COLOUR, lw=1.0, label=f"first {_FIRST_PERIODS} periods"),
        Line2D([], [], color=_LATER_COLOUR, lw=4.0, label="later"),
        Line2D([], [], color=BLUE, lw=2.0, label=f"last {LAST_CYCLES} cycles"),
        Line2D([], [], color=_BELT_COLOUR, lw=0.8, ls="--", label="belt speed"),
        Line2D([], [], color=GREEN, ls="", marker="o", ms=5.0, label="equilibrium"),
    ]
    if any(portrait.measures.stick_fraction for portrait in figure.portraits):
        handles.insert(3, Line2D([], [], color=ORANGE, lw=4.0, label="sticking"))
    style.legend_below(drawn, handles)
    return drawn


def _panel(subfigure: SubFigure, panel: Panel, rows: int, columns: int, style: FigureStyle) -> None:
    title = fill(panel.title, _LINE_LENGTH) if style.narrow else panel.title
    subfigure.suptitle(typeset(title), fontweight="bold")
    # A diverging motion gets a frame of its own: in a common one the others would be too small.
    share = not any(portrait.runs_away for portrait in panel.portraits)
    grid = subfigure.subplots(rows, columns, sharex=share, sharey=share, squeeze=False)
    for axes in grid.flat[len(panel.portraits) :]:
        axes.set_visible(False)
    framed: Axes | None = None
    for number, (axes, portrait) in enumerate(zip(grid.flat, panel.portraits, strict=False)):
        if not portrait.runs_away and not share:
            if framed is not None:
                axes.sharex(framed)
                axes.sharey(framed)
            framed = axes
        axes.margins(0.06)
        _portrait(axes, portrait, style)
        if number % columns == 0:
            axes.set_ylabel(_UNITS.named("velocity", short=True))
        if number + columns >= len(panel.portraits):
            axes.set_xlabel(_UNITS.named("displacement", short=True))
            axes.tick_params(labelbottom=True)


def _portrait(axes: Axes, portrait: Portrait, style: FigureStyle) -> None:
    last, measures, belt_speed = portrait.last_cycles, portrait.measures, portrait.drive.belt_speed
    whole = _framed(portrait)
    first = whole[whole.time <= _FIRST_PERIODS * portrait.drive.natural_period]
    axes.plot(whole.position, whole.velocity, color=_LATER_COLOUR, lw=0.8)
    axes.plot(first.position, first.velocity, color=_FIRST_COLOUR, lw=0.5)
    axes.axhline(belt_speed, color=_BELT_COLOUR, lw=0.8, ls="--")
    if measures.period is not None:
        axes.plot(last.position, last.velocity, color=BLUE, lw=1.6)
        stuck = np.where(last.stuck, last.position, np.nan)
        axes.plot(stuck, np.full(len(last), belt_speed), color=ORANGE, lw=3.0)
    axes.plot(portrait.drive.equilibrium_position, 0.0, "o", color=GREEN, ms=4.0)
    outcome = _outcome(portrait)
    if style.printed:
        outcome = re.sub(r"(?<=[,:]) ", "\n", outcome)
    if style.narrow:
        outcome = outcome.replace("amplitude", "ampl.")
    title = f"{typeset(portrait.case.label)}\n{outcome}"
    axes.set_title(title, fontsize="small")
    axes.locator_params(nbins=4 if style.printed else 5, steps=[1.0, 2.0, 5.0, 10.0])


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
        return f"{outcome}: {typeset(f'{_FRAME:g} v0 at τ = {time:.1f}')}"
    if measures.period is None or measures.amplitude is None:
        return outcome
    if measures.stick_fraction:
        outcome = f"sticks {measures.stick_fraction:.1%}"
    if portrait.settling_time is None:
        outcome = "still settling"
    return f"{outcome}, amplitude {measures.amplitude:#.3g}"
