"""The pictures of a sweep: a bifurcation diagram over one parameter, a map over two."""

from collections.abc import Iterator, Sequence
from itertools import chain, cycle
from math import prod
from pathlib import Path
from textwrap import fill
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip_ros.physics.knots import FloatArray
from stickslip_ros.physics.measures import Regime
from stickslip_ros.plots.regimes import REGIMES
from stickslip_ros.plots.style import GREY, LIGHT_GREY
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.plan import Axis, Carry, Grid
from stickslip_ros.studies.study import Study
from stickslip_ros.studies.transitions import TransitionMap, transition_map, transitions

_FULL: Any = {"mew": 0.0}
_HOLLOW: Any = {"mfc": "white", "mew": 0.8}
"""Markers of motions that are steady, and of those that are not yet."""

_DASHES = ("--", ":", "-.")
"""Of the transitions, one after the other."""

_MOST_SHOWN = 3
"""Values of one transition in the legend."""

_MANY = 5000
"""Points from which on a drawing of lines and curves has them as an image within."""

_DIFFERENT = 0.02
"""Share of the largest amplitude by which up and down differ where there is hysteresis."""

_HYSTERESIS = "#FBF6C9"

_HATCH: Any = {"facecolor": "white", "edgecolor": GREY, "hatch": "////"}
"""Of where there is no result."""

_AWAY = LIGHT_GREY
"""Colour of what runs away, next to a colour bar, which begins with what is nearly black."""

_COLOUR_BARS = {"amplitude": "amplitude (m)", "stick_fraction": "stick fraction"}

_CODED = [regime for regime in REGIMES if regime is not None]
"""The regimes by their numbers in a map."""

_TITLE_WIDTH = 100
"""Letters in each of its lines, three at most."""


def draw_diagram(path: Path, columns: Columns, study: Study) -> None:
    """Write the bifurcation diagram of a sweep over one parameter to `path`.

    Turning points by regime, amplitude and stick fraction, and where theory has the transitions.
    Hollow are the turning points of motions that are not steady yet.
    Carried both ways, what was found upward is narrow and dark, downward wide and pale. The format
    follows the ending.
    """
    grid = _grid(study)
    (axis,) = grid.axes
    both = grid.carry is Carry.BOTH
    figure = Figure(figsize=(8.5, 8.0), layout="constrained")
    figure.suptitle(_title(study), fontsize=10, parse_math=False)
    panels: list[Axes] = list(figure.subplots(3, 1, sharex=True, height_ratios=(3.0, 1.0, 1.0)))
    section, *lines = panels
    section.set_ylabel("turning points of x (m)")
    # The wide ones below the narrow ones.
    for rows, direction in reversed(list(_passes(grid))):
        wide = both and direction is Carry.DOWN
        _draw_section(section, columns, axis, rows, wide=wide)
        look: Any = {"color": LIGHT_GREY, "lw": 5.0} if wide else {"color": "black", "lw": 1.2}
        for axes, (name, label) in zip(lines, _COLOUR_BARS.items(), strict=True):
            axes.plot(columns.values[axis.parameter][rows], getattr(columns, name)[rows], **look)
            axes.set_ylabel(label)
    handles: list[Artist] = [
        Line2D([], [], color=colour, marker="o", ms=5.0, ls="", label=label)
        for _, colour, label in _present(columns)
    ]
    if np.any(~columns.steady & ~_are(columns.regime, None)):
        handles.append(
            Line2D(
                [], [], color="black", marker="o", ms=5.0, ls="", label="not steady yet", **_HOLLOW
            )
        )
    if both:
        handles += [
            Line2D([], [], color="black", marker="o", ms=2.5, label="carried up"),
            Line2D([], [], color=LIGHT_GREY, marker="o", ms=7.0, lw=5.0, label="carried down"),
            *_shade_hysteresis(panels, columns, axis),
        ]
    handles += _mark_transitions(panels, study, axis)
    for axes in lines:
        axes.set_ylim(bottom=0.0)
    lines[-1].set_xlabel(_label(axis))
    ends = _edges(axis)[[0, -1]]
    lines[-1].set_xlim(float(ends.min()), float(ends.max()))
    lines[-1].set_xscale(**_scale(axis))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8)
    figure.savefig(path, dpi=130)


def draw_map(
    path: Path,
    columns: Columns,
    study: Study,
    colour: Literal["regime", "amplitude", "stick_fraction"] = "regime",
) -> None:
    """Write the map of a sweep over two parameters to `path`, the first one from left to right.

    Coloured by regime, amplitude or stick fraction, with the curves on which theory has the
    transitions; hatched where there is no result. Carried both ways, there are two panels. The
    format follows the ending.
    """
    grid = _grid(study)
    first, second = grid.axes
    count = len(grid.directions)
    figure = Figure(figsize=(1.0 + 6.0 * count, 6.2), layout="constrained")
    figure.suptitle(_title(study), fontsize=10, parse_math=False)
    panels: list[Axes] = list(figure.subplots(1, count, sharex=True, sharey=True, squeeze=False)[0])
    found = transition_map(study, (first, second))
    mesh: Any = None
    for axes, (rows, direction) in zip(panels, _passes(grid), strict=True):
        axes.set_xscale(**_scale(first))
        axes.set_yscale(**_scale(second))
        mesh = _draw_cells(axes, columns, grid, rows, colour)
        for _, margins, dashes in _curves(found):
            # White below black is to be seen on any colour.
            for black, width, style in ((False, 3.5, "-"), (True, 1.5, dashes)):
                axes.contour(
                    found.first, found.second, margins, levels=[0.0],
                    colors="black" if black else "white", linewidths=width, linestyles=style,
                )  # fmt: skip
        axes.set_xlabel(_label(first))
        if direction is not None:
            axes.set_title(f"carried {direction} along {second.parameter}", fontsize=10)
    panels[0].set_ylabel(_label(second))
    if colour in _COLOUR_BARS:
        figure.colorbar(mesh, ax=panels, label=_COLOUR_BARS[colour])
    handles: list[Artist] = []
    for regime, filling, label in _present(columns):
        if regime is not None and colour == "regime":
            handles.append(Patch(color=filling, label=label))
        elif regime is Regime.UNBOUNDED:
            handles.append(Patch(color=_AWAY, label=label))
    if _are(columns.regime, None).any():
        handles.append(Patch(**_HATCH, label="no result"))
    handles += [
        Line2D([], [], color="black", ls=dashes, label=name) for name, _, dashes in _curves(found)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8)
    figure.savefig(path, dpi=130)


def _grid(study: Study) -> Grid:
    assert isinstance(study.plan, Grid)
    return study.plan


def _passes(grid: Grid) -> Iterator[tuple[slice, Carry | None]]:
    """Yield which points are of each direction."""
    count = prod(grid.shape)
    for number, direction in enumerate(grid.directions):
        yield slice(number * count, (number + 1) * count), direction


def _present(columns: Columns) -> Iterator[tuple[Regime | None, str, str]]:
    """Yield the regimes that there are, with colour and name."""
    for regime, (colour, label) in REGIMES.items():
        if _are(columns.regime, regime).any():
            yield regime, colour, label if regime is not None else "no result"


def _draw_section(axes: Axes, columns: Columns, axis: Axis, rows: slice, *, wide: bool) -> None:
    """Draw turning points, and strokes at the lower edge for points that have none."""
    values, regimes = columns.values[axis.parameter][rows], columns.regime[rows]
    points = columns.turning_points[rows]
    counts = np.array([len(found) for found in points])
    positions = np.fromiter(chain.from_iterable(points), dtype=float, count=int(counts.sum()))
    size = float(np.clip(800.0 / axis.count, 1.8, 3.0)) + 5.0 * wide
    rasterized = len(positions) > _MANY
    for regime, (colour, _) in REGIMES.items():
        shown = _are(regimes, regime)
        look: Any = {"color": _pale(colour) if wide else colour, "ls": "", "rasterized": rasterized}
        for steady, filled in ((True, _FULL), (False, _HOLLOW)):
            some = shown & (columns.steady[rows] == steady)
            places = np.repeat(values[some], counts[some])
            heights = positions[np.repeat(some, counts)]
            axes.plot(places, heights, marker="o", ms=size, **look, **filled)
        without = values[shown & (counts == 0)]
        height = np.full(len(without), 0.06 if wide else 0.02)
        axes.plot(without, height, marker="|", ms=9.0, transform=axes.get_xaxis_transform(), **look)


def _shade_hysteresis(panels: Sequence[Axes], columns: Columns, axis: Axis) -> list[Artist]:
    """Shade where up and down differ; return what the legend has of it."""
    up, down = columns.amplitude.reshape(2, -1)
    largest = float(np.nanmax(columns.amplitude, initial=0.0))
    differs = np.abs(up - down) > _DIFFERENT * largest
    differs |= np.isnan(up) != np.isnan(down)
    if not differs.any():
        return []
    edges = np.repeat(_edges(axis), 2)[1:-1]
    for axes in panels:
        axes.fill_between(
            edges, 0.0, 1.0, where=np.repeat(differs, 2), transform=axes.get_xaxis_transform(),
            color=_HYSTERESIS, lw=0.0, zorder=0.0,
        )  # fmt: skip
    return [Patch(color=_HYSTERESIS, label="up and down differ (hysteresis)")]


def _mark_transitions(panels: Sequence[Axes], study: Study, axis: Axis) -> list[Artist]:
    """Draw lines at the transitions; return what the legend has of them."""
    handles: list[Artist] = []
    for (name, values), dashes in zip(transitions(study, axis).items(), cycle(_DASHES)):
        look: Any = {"color": "black", "lw": 1.2, "ls": dashes}
        for axes in panels:
            for value in values:
                axes.axvline(value, **look)
        more = [] if len(values) <= _MOST_SHOWN else ["..."]
        shown = ", ".join([f"{value:.5g}" for value in values[:_MOST_SHOWN]] + more)
        handles.append(Line2D([], [], **look, label=f"{name} {shown} {axis.unit}".rstrip()))
    return handles


def _draw_cells(axes: Axes, columns: Columns, grid: Grid, rows: slice, colour: str) -> Any:
    """Draw the cells of a map; return what a colour bar is made of."""
    x, y = (_edges(axis) for axis in grid.axes)

    def draw(values: FloatArray, **look: Any) -> Any:
        cells = np.ma.masked_invalid(values.reshape(grid.shape).T)
        return axes.pcolormesh(x, y, cells, rasterized=len(values) > _MANY, **look)

    axes.patch.set(**_HATCH)
    regimes = columns.regime[rows]
    if colour == "regime":
        codes = np.full(len(regimes), np.nan)
        for code, regime in enumerate(_CODED):
            codes[_are(regimes, regime)] = code
        fillings = ListedColormap([REGIMES[regime][0] for regime in _CODED])
        edges = np.arange(len(_CODED) + 1) - 0.5
        return draw(codes, cmap=fillings, norm=BoundaryNorm(edges, len(_CODED)))
    away = np.where(_are(regimes, Regime.UNBOUNDED), 0.0, np.nan)
    draw(away, cmap=ListedColormap([_AWAY]))
    values: FloatArray = getattr(columns, colour)
    largest = float(np.nanmax(values, initial=0.0)) or 1.0
    return draw(values[rows], cmap="viridis", vmin=0.0, vmax=largest)


def _curves(found: TransitionMap) -> Iterator[tuple[str, npt.NDArray[Any], str]]:
    """Yield the transitions that are within the map: name, margins by row, and dashes."""
    for (name, margins), dashes in zip(found.margins.items(), cycle(_DASHES)):
        if np.nanmin(margins) < 0.0 < np.nanmax(margins):
            yield name, np.ma.masked_invalid(margins.T), dashes


def _are(regimes: npt.NDArray[np.object_], regime: Regime | None) -> npt.NDArray[np.bool_]:
    return np.array([found is regime for found in regimes])


def _edges(axis: Axis) -> FloatArray:
    """Return where the cells around the values of an axis end, one more than these."""
    values = axis.values()
    if axis.logarithmic:
        values = np.log(np.abs(values))
    middles = (values[:-1] + values[1:]) / 2.0
    edges = np.concatenate(
        [[2.0 * values[0] - middles[0]], middles, [2.0 * values[-1] - middles[-1]]]
    )
    return np.copysign(np.exp(edges), axis.first) if axis.logarithmic else edges


def _scale(axis: Axis) -> dict[str, Any]:
    """Return the scale of a picture's axis; a logarithmic one may be of values below zero."""
    if not axis.logarithmic:
        return {"value": "linear"}
    if axis.first > 0.0:
        return {"value": "log"}
    return {"value": "symlog", "linthresh": min(abs(axis.first), abs(axis.last))}


def _label(axis: Axis) -> str:
    return f"{axis.parameter} ({axis.unit})" if axis.unit else axis.parameter


def _title(study: Study) -> str:
    scenario = study.scenario
    changed = f", {' '.join(scenario.overrides)}" if scenario.overrides else ""
    text = f"What {scenario.name} settles on{changed}"
    return fill(text, _TITLE_WIDTH, max_lines=3, placeholder=" ...")


def _pale(colour: str) -> tuple[float, ...]:
    return tuple(1.0 - 0.4 * (1.0 - part) for part in to_rgb(colour))
