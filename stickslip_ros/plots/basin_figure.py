"""Figure of basins of attraction: the motion that each start leads to."""

from collections.abc import Iterator, Sequence
from itertools import cycle
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.plots.regimes import REGIMES, Look, draw_cells, patch
from stickslip_ros.plots.study_tables import attractor_name
from stickslip_ros.plots.style import (
    AMBER,
    MANY,
    PURPLE,
    SCREEN,
    SKY_BLUE,
    YELLOW,
    FigureStyle,
    finish,
    styled,
    title_of,
)
from stickslip_ros.plots.units import SI, Units
from stickslip_ros.studies.basin import POSITION, VELOCITY, Attractor, Basins
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.plan import Grid
from stickslip_ros.studies.study import Study

_WHAT = "Basins of attraction"


def study_figure(
    columns: Columns, basins: Basins, study: Study, *, style: FigureStyle = SCREEN
) -> Figure:
    """Return the figure of which attractor each start of a study leads to."""
    plan, scenario = study.plan, study.scenario
    drive = scenario.plant.as_drive()
    units = Units.for_drive(drive)
    return basin_figure(
        position=columns.values[POSITION],
        velocity=columns.values[VELOCITY],
        attractor=basins.places,
        regimes=[attractor.regime for attractor in basins.attractors],
        labels=[_label(attractor, units) for attractor in basins.attractors],
        grid_shape=plan.shape if isinstance(plan, Grid) else None,
        belt_speed=drive.belt_speed,
        equilibrium_position=drive.equilibrium_position if drive.has_spring else None,
        units=units,
        title=title_of(_WHAT, scenario),
        style=style,
    )


@styled
def basin_figure(
    *,
    position: FloatArray,
    velocity: FloatArray,
    attractor: npt.NDArray[np.intp],
    regimes: Sequence[Regime | None],
    labels: Sequence[str],
    grid_shape: tuple[int, ...] | None,
    belt_speed: float,
    equilibrium_position: float | None,
    units: Units = SI,
    title: str = _WHAT,
    style: FigureStyle = SCREEN,
) -> Figure:
    """Return the figure of the attractor that each of n starts leads to.

    `position` (m) and `velocity` (m/s) are those of the starts, and `attractor` is the index of
    each one's attractor in `regimes` and `labels`; arrays of shape (n,). The starts are a row-major
    grid of `grid_shape`, or scattered if that is None. Lines mark the `belt_speed` (m/s) and a
    circle the equilibrium at `equilibrium_position` (m), if there is one.
    """
    figure = style.figure(7.5, 6.8, narrow=1.25)
    style.set_title(figure, title, f"the motion that each of {len(attractor)} starts leads to")
    axes = figure.subplots()
    axes.grid(visible=False)
    length, x_label = units.axis(units.named("initial displacement"), "m", position)
    speed, y_label = units.axis(units.named("initial velocity"), "m/s", velocity, belt_speed)
    x, y = position / length, velocity / speed
    handles: list[Any] = []
    rasterized = len(attractor) > MANY
    area = float(np.clip(2e5 / max(len(attractor), 1), 4.0, 30.0))
    for number, (look, label) in enumerate(zip(_looks(regimes), labels, strict=True)):
        of_it = attractor == number
        if grid_shape is not None:
            middles = x.reshape(grid_shape), y.reshape(grid_shape)
            draw_cells(axes, *middles, of_it.reshape(grid_shape), look, shading="nearest")
            handles.append(patch(look, label))
        else:
            points: Any = {"color": look.colour, "marker": look.marker, "label": label}
            axes.scatter(x[of_it], y[of_it], s=area, lw=0.0, rasterized=rasterized, **points)
            handles.append(Line2D([], [], ls="", **points))
    if grid_shape is not None:  # white below black is visible on any colour
        axes.axhline(belt_speed / speed, color="white", lw=3.0)
    axes.axhline(belt_speed / speed, color="black", lw=1.2, ls="--")
    handles.append(Line2D([], [], color="black", lw=1.2, ls="--", label="belt speed"))
    if equilibrium_position is not None:
        circle: Any = {"color": "white", "mec": "black", "mew": 1.5, "marker": "o", "ls": ""}
        axes.plot(equilibrium_position / length, 0.0, ms=8.0, **circle)
        handles.append(Line2D([], [], label="equilibrium", **circle))
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    style.legend_below(figure, handles, most=2)
    finish(figure)
    return figure


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
