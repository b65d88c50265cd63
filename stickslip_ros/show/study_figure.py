"""Figures of studies: the bifurcation diagram or map of a sweep, and basins of attraction."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, cycle
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.show import AMBER, GREY, INK, LIGHT_GREY, PURPLE, SKY_BLUE, YELLOW
from stickslip_ros.show.drawing import label_axis
from stickslip_ros.show.quantities import MEASURES, Units, check_colour
from stickslip_ros.show.regimes import REGIMES, Look
from stickslip_ros.show.study_tables import attractor_name
from stickslip_ros.show.style import DASHES, MANY, SCREEN, FigureStyle, finish, styled, title_of
from stickslip_ros.studies.basin import POSITION, VELOCITY, Attractor, Basins
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.plan import Axis, Continuation, Grid
from stickslip_ros.studies.study import Study
from stickslip_ros.studies.transitions import (
    TransitionMap,
    transition_label,
    transition_map,
    transitions,
)

_FULL: Any = {"mew": 0.0}
_HOLLOW: Any = {"mfc": "white", "mew": 0.8}
"""Markers of steady motions, and of motions that are not steady yet."""

_MOST_SHOWN = 4
"""Largest number of values of one transition in the legend."""

_HYSTERESIS = "#FBF6C9"

_HATCH: Any = {"facecolor": "white", "edgecolor": GREY, "hatch": "////"}
"""Look of cells without a result."""

_AWAY = REGIMES[Regime.UNBOUNDED]._replace(colour=LIGHT_GREY, hatch="...")
"""Look of diverging motions next to a colour bar, which starts with a near black."""

_MEASURES = {name: MEASURES[name] for name in ("amplitude", "stick_fraction")}
"""Measures that a diagram shows below the turning points."""


def sweep_figure(
    columns: Columns, study: Study, colour: str = "regime", *, style: FigureStyle = SCREEN
) -> Figure:
    """Return the bifurcation diagram of a sweep over one parameter, the map of one over two.

    Raises InvalidInputError for an unknown `colour`, and in a diagram for any but the regime.
    """
    axes = len(_grid(study).axes)
    check_colour(colour, axes)
    if axes == 2:
        return map_figure(columns, study, colour, style=style)
    return diagram_figure(columns, study, style=style)


@styled
def diagram_figure(columns: Columns, study: Study, *, style: FigureStyle = SCREEN) -> Figure:
    """Return the bifurcation diagram of a sweep over one parameter.

    It shows turning points by regime, amplitude, stick fraction, and the transitions by theory.
    Markers of motions that are not steady yet are hollow. If the sweep is carried both ways,
    upward results are narrow and dark, downward results wide and pale.
    """
    grid = _grid(study)
    (axis,) = grid.axes
    both = grid.continuation is Continuation.BOTH
    drive_units = Units.for_drive(study.scenario.plant.as_drive(), grid.parameters)
    units, terse = drive_units.shortened(terse=style.crowded(8.5, 8.0)), drive_units.shortened()
    figure = style.figure(8.5, 8.0, narrow=1.7)
    what = "Bifurcation diagram"
    style.set_title(figure, title_of(what, study.scenario, grid.parameters))
    panels: list[Axes] = list(figure.subplots(3, 1, sharex=True, height_ratios=(3.0, 1.0, 1.0)))
    section, *lines = panels
    every = np.fromiter(chain.from_iterable(columns.turning_points), dtype=float)
    length, label = terse.axis(terse.named("turning points"), "m", every)
    section.set_ylabel(label)
    scaled = {
        name: terse.axis(label, unit, getattr(columns, name))
        for name, (label, unit, _) in _MEASURES.items()
    }
    # Wide markers are drawn below the narrow ones.
    for rows, direction in reversed(list(_passes(grid))):
        wide = both and direction is Continuation.DOWN
        parts = columns.values[axis.parameter][rows], columns.regime[rows]
        points, settled = columns.turning_points[rows], columns.steady[rows]
        draw_section(section, *parts, points, settled, length=length, wide=wide)
        look: Any = {"color": LIGHT_GREY, "lw": 5.0} if wide else {"color": "black", "lw": 1.2}
        for axes, (name, (scale, label)) in zip(lines, scaled.items(), strict=True):
            values: FloatArray = getattr(columns, name)[rows]
            axes.plot(columns.values[axis.parameter][rows], values / scale, **look)
            axes.set_ylabel(label)
    handles = regime_handles(columns.regime)
    black: Any = {"color": "black", "marker": "o"}
    if np.any(~columns.steady & ~_are(columns.regime, None)):
        look = {**black, **_HOLLOW, "ms": 5.0, "ls": ""}
        handles.append(Line2D([], [], **look, label="not steady yet"))
    if both:
        handles += [
            Line2D([], [], **black, ms=2.5, label="carried up"),
            Line2D([], [], color=LIGHT_GREY, marker="o", ms=7.0, lw=5.0, label="carried down"),
            *_shade_hysteresis(panels, columns, axis),
        ]
    handles += _mark_transitions(panels, study, axis, units)
    for axes in lines:
        axes.set_ylim(bottom=0.0)
    lines[-1].set_xscale(**_scale(axis))
    _name_axis(lines[-1].xaxis, axis, units)
    lines[-1].margins(x=0.01)
    style.legend_below(figure, handles, most=3)
    finish(figure)
    return figure


@styled
def map_figure(
    columns: Columns, study: Study, colour: str = "regime", *, style: FigureStyle = SCREEN
) -> Figure:
    """Return the map of a sweep over two parameters, the first one on the horizontal axis.

    Cells are coloured by regime or by a measure, and hatched without a result. Curves show the
    transitions by theory. If the sweep is carried both ways, there are two panels.
    """
    grid = _grid(study)
    first, second = grid.axes
    count = len(grid.directions)
    units = Units.for_drive(study.scenario.plant.as_drive(), grid.parameters)
    figure = style.figure(1.0 + 6.0 * count, 6.2, narrow=0.3 + 0.9 * count)
    name, unit, _ = MEASURES[colour]
    what = f"Map of the {name} of settled motions"
    style.set_title(figure, title_of(what, study.scenario, grid.parameters))
    shape = (count, 1) if style.narrow else (1, count)
    panels: list[Axes] = list(figure.subplots(*shape, sharex=True, sharey=True, squeeze=False).flat)
    theory = transition_map(study, (first, second))
    mesh, scale, bar = None, 1.0, ""
    if colour != "regime":
        scale, bar = units.axis(name, unit, getattr(columns, colour))
    for axes, (rows, direction) in zip(panels, _passes(grid), strict=True):
        axes.set_xscale(**_scale(first))
        axes.set_yscale(**_scale(second))
        axes.grid(visible=False)
        axes.patch.set(**_HATCH)
        if colour == "regime":
            _draw_regimes(axes, columns, grid, rows)
        else:
            mesh = _draw_values(axes, columns, grid, rows, getattr(columns, colour) / scale)
        for _, margins, dashes in _curves(theory):
            # White below black is visible on any colour.
            for black, width, pattern in ((False, 3.5, "-"), (True, 1.5, dashes)):
                axes.contour(
                    theory.first, theory.second, margins, levels=[0.0],
                    colors="black" if black else "white", linewidths=width, linestyles=pattern,
                )  # fmt: skip
        if axes is panels[-1] or not style.narrow:
            _name_axis(axes.xaxis, first, units)
        if axes is panels[0] or style.narrow:
            _name_axis(axes.yaxis, second, units)
        if direction is not None:
            axes.set_title(f"carried {direction} along the {units.named(second.parameter)}")
    if mesh is not None:
        figure.colorbar(mesh, ax=panels, label=bar)
    handles: list[Artist] = []
    for regime, look in _present(columns.regime):
        if regime is not None and colour == "regime":
            handles.append(_patch(look, look.label))
        elif regime is Regime.UNBOUNDED:
            handles.append(_patch(_AWAY, look.label))
    if _are(columns.regime, None).any():
        handles.append(Patch(**_HATCH, label="no result"))
    handles += [
        Line2D([], [], color="black", ls=dashes, label=name) for name, _, dashes in _curves(theory)
    ]
    style.legend_below(figure, handles, most=4)
    finish(figure)
    return figure


@styled
def basin_figure(
    columns: Columns, basins: Basins, study: Study, *, style: FigureStyle = SCREEN
) -> Figure:
    """Return the figure of which attractor each start of a study leads to.

    A line marks the belt speed and a circle the equilibrium, if there is one.
    """
    plan, drive = study.plan, study.scenario.plant.as_drive()
    units, belt_speed = Units.for_drive(drive), drive.belt_speed
    position, velocity = columns.values[POSITION], columns.values[VELOCITY]
    figure = style.figure(7.5, 6.8, narrow=1.25)
    title = title_of("Basins of attraction", study.scenario)
    style.set_title(figure, title, f"the motion that each of {plan.size} starts leads to")
    axes = figure.subplots()
    axes.grid(visible=False)
    length, x_label = units.axis(units.named("initial displacement"), "m", position)
    speed, y_label = units.axis(units.named("initial velocity"), "m/s", velocity, belt_speed)
    x, y = position / length, velocity / speed
    handles: list[Any] = []
    rasterized = plan.size > MANY
    area = float(np.clip(2e5 / max(plan.size, 1), 4.0, 30.0))
    looks = _looks([attractor.regime for attractor in basins.attractors])
    for number, (look, attractor) in enumerate(zip(looks, basins.attractors, strict=True)):
        of_it, label = basins.places == number, _label(attractor, units)
        if isinstance(plan, Grid):
            middles = x.reshape(plan.shape), y.reshape(plan.shape)
            _draw_cells(axes, *middles, of_it.reshape(plan.shape), look, shading="nearest")
            handles.append(_patch(look, label))
        else:
            points: Any = {"color": look.colour, "marker": look.marker, "label": label}
            axes.scatter(x[of_it], y[of_it], s=area, lw=0.0, rasterized=rasterized, **points)
            handles.append(Line2D([], [], ls="", **points))
    if isinstance(plan, Grid):  # white below black is visible on any colour
        axes.axhline(belt_speed / speed, color="white", lw=3.0)
    belt: Any = {"color": "black", "lw": 1.2, "ls": "--", "label": "belt speed"}
    handles.append(axes.axhline(belt_speed / speed, **belt))
    if drive.has_spring:
        circle: Any = {"color": "white", "mec": "black", "mew": 1.5, "marker": "o", "ls": ""}
        axes.plot(drive.equilibrium_position / length, 0.0, ms=8.0, **circle)
        handles.append(Line2D([], [], label="equilibrium", **circle))
    axes.set(xlabel=x_label, ylabel=y_label)
    style.legend_below(figure, handles, most=2)
    finish(figure)
    return figure


def _grid(study: Study) -> Grid:
    assert isinstance(study.plan, Grid)
    return study.plan


def _passes(grid: Grid) -> Iterator[tuple[slice, Continuation | None]]:
    """Yield the points of each direction."""
    count = prod(grid.shape)
    for number, direction in enumerate(grid.directions):
        yield slice(number * count, (number + 1) * count), direction


def _present(regimes: npt.NDArray[np.object_]) -> Iterator[tuple[Regime | None, Look]]:
    for regime, look in REGIMES.items():
        if _are(regimes, regime).any():
            yield regime, look if regime is not None else look._replace(label="no result")


def regime_handles(regimes: npt.NDArray[np.object_]) -> list[Artist]:
    """Return the legend entries of the regimes that there are."""
    return [
        Line2D([], [], color=look.colour, marker=look.marker, ms=5.0, ls="", label=look.label)
        for _, look in _present(regimes)
    ]


def draw_section(
    axes: Axes,
    values: FloatArray,
    regimes: npt.NDArray[np.object_],
    points: Sequence[Sequence[float] | FloatArray],
    settled: BoolArray | None = None,
    *,
    length: float = 1.0,
    wide: bool = False,
) -> None:
    """Draw turning points by regime, hollow unless `settled`, with strokes where there are none.

    `length` is the divisor of their positions.
    """
    counts = np.array([len(turns) for turns in points])
    positions = np.fromiter(chain.from_iterable(points), dtype=float, count=int(counts.sum()))
    size = float(np.clip(800.0 / len(values), 1.8, 3.0)) + 5.0 * wide
    steady = np.ones(len(values), dtype=bool) if settled is None else settled
    rasterized = len(positions) > MANY
    for regime, (colour, _, marker, _) in REGIMES.items():
        shown = _are(regimes, regime)
        pale = tuple(1.0 - 0.4 * (1.0 - part) for part in to_rgb(colour))
        look: Any = {"color": pale if wide else colour, "ls": "", "rasterized": rasterized}
        for full, filled in ((True, _FULL), (False, _HOLLOW)):
            some = shown & (steady == full)
            places = np.repeat(values[some], counts[some])
            heights = positions[np.repeat(some, counts)] / length
            axes.plot(places, heights, marker=marker, ms=size, **look, **filled)
        without = values[shown & (counts == 0)]
        height = np.full(len(without), 0.06 if wide else 0.02)
        axes.plot(without, height, marker="|", ms=9.0, transform=axes.get_xaxis_transform(), **look)


def _shade_hysteresis(panels: Sequence[Axes], columns: Columns, axis: Axis) -> list[Artist]:
    """Shade the ranges where up and down differ; return their legend entry."""
    up, down = columns.amplitude.reshape(2, -1)
    largest = float(np.nanmax(columns.amplitude, initial=0.0))
    differs = np.abs(up - down) > 0.02 * largest  # less is not hysteresis
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


def _name_axis(drawn: XAxis | YAxis, axis: Axis, units: Units) -> None:
    """Name the axis of a parameter; its numbers get a prefix, but for those of a logarithm."""
    name = units.named(axis.parameter)
    if axis.logarithmic:
        drawn.set_label_text(units.label(name, axis.unit))
    else:
        label_axis(drawn, *units.axis(name, axis.unit, axis.values()))


def _mark_transitions(
    panels: Sequence[Axes], study: Study, axis: Axis, units: Units
) -> list[Artist]:
    """Draw lines at the transitions; return their legend entries."""

    def text(values: Sequence[float]) -> str:
        more = [] if len(values) <= _MOST_SHOWN else ["..."]
        return ", ".join(units.texts(values[:_MOST_SHOWN], axis.unit, 5) + more)

    speeds = transitions(study, axis).items()
    marks = {transition_label(name, axis.parameter): values for name, values in speeds}
    return draw_transitions(panels, marks, text)


def draw_transitions(
    panels: Sequence[Axes],
    marks: Mapping[str, Sequence[float]],
    text: Callable[[Sequence[float]], str],
) -> list[Artist]:
    """Draw lines at the transitions, by label; return legend entries, with a text of the values."""
    handles: list[Artist] = []
    for (label, values), dashes in zip(marks.items(), cycle(DASHES)):
        look: Any = {"color": "black", "lw": 1.2, "ls": dashes}
        for axes in panels:
            for value in values:
                axes.axvline(value, **look)
        handles.append(Line2D([], [], **look, label=f"{label} {text(values)}"))
    return handles


def _draw_regimes(axes: Axes, columns: Columns, grid: Grid, rows: slice) -> None:
    x, y = (_edges(axis) for axis in grid.axes)
    for regime, look in _present(columns.regime):
        if regime is not None:
            of_it = _are(columns.regime[rows], regime).reshape(grid.shape).T
            _draw_cells(axes, x, y, of_it, look)


def _draw_values(axes: Axes, columns: Columns, grid: Grid, rows: slice, values: FloatArray) -> Any:
    """Draw the cells of a map by a measure; return the mesh for a colour bar."""
    x, y = (_edges(axis) for axis in grid.axes)
    away = _are(columns.regime[rows], Regime.UNBOUNDED).reshape(grid.shape).T
    _draw_cells(axes, x, y, away, _AWAY)
    cells = np.ma.masked_invalid(values[rows].reshape(grid.shape).T)
    low, high = (float(end(values, initial=0.0)) for end in (np.nanmin, np.nanmax))
    look: Any = {"cmap": "viridis", "vmin": low, "vmax": high if high > low else low + 1.0}
    return axes.pcolormesh(x, y, cells, rasterized=cells.size > MANY, **look)


def _curves(transitions_map: TransitionMap) -> Iterator[tuple[str, npt.NDArray[Any], str]]:
    """Yield the transitions within the map: name, margins by row, and dashes."""
    for (name, margins), dashes in zip(transitions_map.margins.items(), cycle(DASHES)):
        if np.nanmin(margins) < 0.0 < np.nanmax(margins):
            yield transition_label(name), np.ma.masked_invalid(margins.T), dashes


def _are(regimes: npt.NDArray[np.object_], regime: Regime | None) -> npt.NDArray[np.bool_]:
    return np.array([value is regime for value in regimes])


def _edges(axis: Axis) -> FloatArray:
    """Return the edges of the cells around the values of an axis, one more than these.

    The first and the last cell are half as wide, since there is no result beyond their values.
    """
    values = axis.values()
    if axis.logarithmic:
        values = np.log(np.abs(values))
    middles = (values[:-1] + values[1:]) / 2.0
    edges = np.concatenate([values[:1], middles, values[-1:]])
    return np.copysign(np.exp(edges), axis.first) if axis.logarithmic else edges


def _scale(axis: Axis) -> dict[str, Any]:
    """Return the scale of a figure's axis; a logarithmic one may have negative values."""
    if not axis.logarithmic:
        return {"value": "linear"}
    if axis.first > 0.0:
        return {"value": "log"}
    return {"value": "symlog", "linthresh": min(abs(axis.first), abs(axis.last))}


def _looks(regimes: Sequence[Regime | None]) -> Iterator[Look]:
    """Yield the look of each attractor: that of its regime, or another one if that is in use."""
    colours = cycle((SKY_BLUE, YELLOW, PURPLE, AMBER))
    # Together they repeat after twenty.
    more = zip(colours, cycle("v*P<>"), cycle(("+++", "", "ooo", "|||", "---")), strict=False)
    for number, regime in enumerate(regimes):
        look = REGIMES[regime]
        if regime in regimes[:number]:
            colour, marker, hatch = next(more)
            look = look._replace(colour=colour, marker=marker, hatch=hatch)
        yield look


def _label(attractor: Attractor, units: Units) -> str:
    amplitude = ""
    if attractor.amplitude is not None:
        amplitude = f", amplitude {units.text(attractor.amplitude, 'm')}"
    share, error = 100.0 * attractor.share, 100.0 * attractor.standard_error
    return (
        f"{attractor_name(attractor)}{amplitude}: {share:.1f} % \N{PLUS-MINUS SIGN} {error:.1f} %"
    )


def _draw_cells(
    axes: Axes, x: FloatArray, y: FloatArray, shown: BoolArray, look: Look, **more: Any
) -> None:
    """Fill the cells of a grid that are `shown`, in the colour and with the hatch of a look."""
    if not shown.any():
        return
    rasterized = shown.size > MANY
    filling = ListedColormap([look.colour])
    cells = np.where(shown, 0.0, np.nan)
    mesh: Any = axes.pcolormesh(x, y, cells, cmap=filling, rasterized=rasterized, **more)
    if not look.hatch:
        return
    # One outline of all cells: hatching each cell takes a hundred times as long.
    corners = mesh.get_coordinates()
    around = corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]
    outlines = np.stack([corner[shown] for corner in (*around, around[0])], axis=1)
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    outline: Any = Path(outlines.reshape(-1, 2), np.tile(codes, len(outlines)))
    hatched: Any = PathPatch(outline, lw=0.0, rasterized=rasterized, hatch=look.hatch)
    hatched.set(facecolor="none", edgecolor=INK)
    axes.add_patch(hatched)


def _patch(look: Look, label: str) -> Patch:
    """Return the legend entry of such cells."""
    return Patch(facecolor=look.colour, hatch=look.hatch, edgecolor=INK, lw=0.0, label=label)
