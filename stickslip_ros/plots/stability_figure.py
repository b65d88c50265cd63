"""Figures of stability: the map of a scenario or a design, or a bifurcation diagram by theory."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.physics.theory.stability_map import CriticalGainCurves, StabilityMap
from stickslip_ros.plots.branches_figure import branches_figure
from stickslip_ros.plots.regimes import INK
from stickslip_ros.plots.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SCREEN,
    SKY_BLUE,
    FigureStyle,
    finish,
    styled,
    title_of,
)
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.design import Design
from stickslip_ros.studies.stability import bifurcation_branches, stability_map

_UNSTABLE = "#E4E4E4"
_GAINS: Any = {"color": "white", "mec": "black", "marker": "*", "ls": "", "zorder": 5.0}
_LIMIT: Any = {"color": ORANGE, "lw": 2.0}
_CONTINUOUS: Any = {"color": "black", "ls": "--", "lw": 1.2}
_FORCE: Any = {"color": "black", "ls": (0, (5.0, 1.0, 1.0, 1.0)), "lw": 1.4}
_BEYOND = "//"
"""Hatch of gains that need more than the force limit."""
_STEPS = [1.0, 2.0, 2.5, 5.0, 10.0]
_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "ls": "-"},
    {"color": ORANGE, "ls": "--"},
    {"color": GREEN, "ls": "-."},
    {"color": SKY_BLUE, "ls": ":"},
    {"color": "black", "ls": (0, (5, 1, 1, 1, 1, 1))},
    {"color": PURPLE, "ls": (0, (1, 1))},
)
"""Looks of the curves, one for each rate."""


def scenario_stability_figure(scenario: Scenario, *, style: FigureStyle = SCREEN) -> Figure:
    """Return the map of a scenario with control, the bifurcation diagram of one without.

    Call it only if `why_no_figure` returns None.
    """
    if scenario.control_law is None:
        title = title_of("Bifurcation diagram", scenario, ["plant.belt_speed"])
        return branches_figure(bifurcation_branches(scenario), title=title, style=style)
    title = title_of("Stability of the sampled loop", scenario)
    return stability_figure(*stability_map(scenario), title=title, style=style)


@styled
def stability_figure(
    found: StabilityMap,
    critical: CriticalGainCurves | None,
    *,
    title: str = "",
    style: FigureStyle = SCREEN,
) -> Figure:
    """Return the figure of the map and, if given, of the critical gains over the delay."""
    figure = style.figure(*((6.4, 5.8) if critical is None else (12.0, 5.6)), narrow=2.0)
    _set_title(figure, title, found, style)
    count = 1 if critical is None else 2
    shape = (count, 1) if style.narrow else (1, count)
    panels = figure.subplots(*shape, squeeze=False).ravel()
    handles = _draw_map(figure, panels[0], found)
    if critical is not None:
        _draw_critical_gains(panels[1], critical, found)
    style.legend_below(figure, handles, most=4)
    finish(figure)
    return figure


@styled
def design_figure(found: Design, *, style: FigureStyle = SCREEN) -> Figure:
    """Return the map around a proposal, with the force limit; there must be a proposal."""
    around, scenario = found.map_around(), found.scenario
    assert around is not None
    figure = style.figure(6.8, 6.2, narrow=1.2)
    what = "Designed gains"
    title = what if scenario is None else title_of(what, scenario, _PROPOSED)
    _set_title(figure, title, around, style)
    axes = figure.subplots()
    handles = _draw_map(figure, axes, around)
    forces = found.peak_forces(around)
    handles += _draw_forces(axes, around, forces, found.task.force_limit)
    style.legend_below(figure, handles, most=3)
    finish(figure)
    return figure


_PROPOSED = (
    "plant.belt_speed",
    *(
        f"washout_controller.{name}"
        for name in ("corner_frequency", "linear_gain", "cubic_gain", "start_after", "force_limit")
    ),
)
"""Parameters that are not in the title of a design: its results, and what the figure shows."""


def _set_title(figure: Figure, title: str, found: StabilityMap, style: FigureStyle) -> None:
    loop = found.loop
    units = Units.for_drive(loop.drive)
    belt, rate = units.text(loop.drive.belt_speed, "m/s"), units.text(loop.rate, "Hz")
    late = units.text(loop.force_delay, "s")
    delay = f", force delay {late}" if loop.force_delay > 0.0 else ""
    values = f"belt speed {belt}, sample rate {rate}{delay}"
    style.set_title(figure, *([title] if title else []), values)


def _draw_map(figure: Figure, axes: Axes, found: StabilityMap) -> list[Artist]:
    """Draw the decay rates; return the entries of the legend."""
    corners, gains, rates = found.corner_frequencies, found.linear_gains, found.decay_rates.T
    units = Units.for_drive(found.loop.drive)
    axes.grid(visible=False)
    axes.set_facecolor(_UNSTABLE)
    fastest = float(rates.max())
    if fastest > 0.0:
        levels = MaxNLocator(8, steps=_STEPS).tick_values(0.0, fastest)
        filled = axes.contourf(corners, gains, rates, levels=levels, cmap="viridis")
        figure.colorbar(filled, ax=axes, label=units.label("decay rate", "1/s"), ticks=levels)
        axes.contour(corners, gains, rates, levels=[0.0], colors=[ORANGE], linewidths=2.0)
    axes.plot(corners, found.continuous, **_CONTINUOUS)
    axes.plot(found.gains.corner_frequency, found.gains.linear_gain, **_GAINS, ms=14)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xscale("log")
    axes.set_xlim(corners[0], corners[-1])
    axes.set_ylim(gains[0], gains[-1])
    axes.set_xlabel(units.label(units.named("cutoff frequency"), "rad/s"))
    axes.set_ylabel(units.label(units.named("linear gain"), "N s/m"))
    for stable, name in ((rates > 0.0, "stable"), (rates < 0.0, "unstable")):
        place = _roomiest(stable, found)
        if place is not None:
            colour, stroke = ("white", "black") if name == "stable" else (INK, "white")
            axes.text(
                *place, name, color=colour, ha="center", va="center",
                path_effects=[withStroke(linewidth=1.5, foreground=stroke)],
            )  # fmt: skip
    return [
        Line2D([], [], **_LIMIT, label="limit of stability, sampled"),
        Line2D([], [], **_CONTINUOUS, label="limit of stability, continuous"),
        Line2D([], [], **_GAINS, ms=10, label="gains"),
        Patch(facecolor=_UNSTABLE, edgecolor=GREY, label="unstable"),
    ]


def _roomiest(shown: BoolArray, found: StabilityMap) -> tuple[float, float] | None:
    """Return the middle of the most room among the cells that are shown; None if there is little.

    The gains, and the edges of the map, are in the way of a text there.
    """
    from scipy.ndimage import distance_transform_edt  # importing it takes long

    columns, rows = len(found.corner_frequencies), len(found.linear_gains)
    free = shown.copy()
    column = int(np.abs(np.log(found.corner_frequencies / found.gains.corner_frequency)).argmin())
    row = int(np.abs(found.linear_gains - found.gains.linear_gain).argmin())
    width, height = columns // 12, rows // 16
    free[max(row - height, 0) : row + height + 1, max(column - width, 0) : column + width + 1] = 0
    # A text is three times as wide as high.
    distances: Any = distance_transform_edt(np.pad(free, 1), sampling=(3.0, 1.0))
    best = np.unravel_index(int(distances.argmax()), distances.shape)
    if distances[best] < columns / 9.0:
        return None
    return (
        float(found.corner_frequencies[int(best[1]) - 1]),
        float(found.linear_gains[int(best[0]) - 1]),
    )


def _draw_forces(
    axes: Axes, around: StabilityMap, forces: FloatArray, limit: float
) -> list[Artist]:
    """Draw contours of the force; return the entries of the legend.

    With a limit there is one contour, at the limit. Gains beyond it are hatched.
    """
    units = Units.for_drive(around.loop.drive)
    corners, gains, largest = around.corner_frequencies, around.linear_gains, float(forces.max())
    if largest == 0.0:
        return []
    limited = limit < largest
    ticks = [limit] if limited else MaxNLocator(5, steps=_STEPS).tick_values(0.0, largest)
    levels = [float(level) for level in ticks if level > 0.0]
    if limited:
        axes.contourf(
            corners, gains, forces.T, levels=[limit, np.inf], colors="none", hatches=[_BEYOND]
        )
    for look, width in (("white", 3.0), ("black", _FORCE["lw"])):
        drawn = axes.contour(
            corners, gains, forces.T, levels=levels, colors=look, linewidths=width,
            linestyles="-" if look == "white" else [_FORCE["ls"]],
        )  # fmt: skip
        if look == "black" and not limited:
            names = {level: units.text(level, "N") for level in levels}
            texts = axes.clabel(drawn, fmt=names, fontsize=7.0)
            for text in texts:
                text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    if not limited:
        return [Line2D([], [], **_FORCE, label="largest force at switch-on")]
    shown = units.text(limit, "N")
    hatched = Patch(facecolor="white", edgecolor=INK, lw=0.0, hatch=_BEYOND)
    hatched.set_label("needs a larger force")
    return [Line2D([], [], **_FORCE, label=f"force limit {shown}"), hatched]


def _draw_critical_gains(axes: Axes, critical: CriticalGainCurves, found: StabilityMap) -> None:
    units = Units.for_drive(found.loop.drive)
    late, label = units.axis("force delay", "s", critical.force_delays)
    axes.set_xlabel(label)
    for index, (rate, gains) in enumerate(zip(critical.rates, critical.linear_gains, strict=True)):
        look = _LOOKS[index % len(_LOOKS)]
        # At a change of sign the curve jumps from one interval of gains to another.
        jumps = np.flatnonzero(gains[:-1] * gains[1:] < 0.0) + 1
        delays = np.insert(critical.force_delays, jumps, np.nan)
        label = units.text(float(rate), "Hz")
        width, label = (2.8, f"{label}, this loop") if rate == found.loop.rate else (1.2, label)
        axes.plot(delays / late, np.insert(gains, jumps, np.nan), **look, lw=width, label=label)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.plot(
        found.loop.force_delay / late, found.gains.linear_gain, **_GAINS, ms=14, clip_on=False
    )
    axes.set_ylabel(units.label(units.named("critical linear gain"), "N s/m"))
    corner = found.gains.corner_frequency
    axes.set_title(f"cutoff frequency {corner:.3g}{'' if units.dimensionless else ' rad/s'}")
    axes.margins(x=0.04)
    limits = axes.get_ylim()
    for row in np.flatnonzero(critical.rates == found.loop.rate).tolist():
        ends, own = (critical.linear_gains[row], critical.other_ends[row]), axes.lines[row]
        axes.fill_between(critical.force_delays / late, *ends, color=own.get_color(), alpha=0.2)
        axes.collections[-1].set_label("stable, this loop")
    axes.set_ylim(limits)
    axes.legend(title="sample rate")
