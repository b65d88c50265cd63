"""Figures of stability: the map of a scenario or a design, or a bifurcation diagram by theory."""

from collections.abc import Iterator
from itertools import pairwise
from math import isclose
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
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, SKY_BLUE
from stickslip_ros.show.quantities import Units
from stickslip_ros.show.regimes import REGIMES
from stickslip_ros.show.style import (
    DASHES,
    SCREEN,
    FigureStyle,
    finish,
    styled,
    text_width,
    title_of,
)
from stickslip_ros.studies.design import Design
from stickslip_ros.theory.bifurcation_branches import BifurcationBranches, Branch, require_branches
from stickslip_ros.theory.gain_intervals import gains_of, why_no_gains
from stickslip_ros.theory.linear_sampled_loop import (
    LONGEST_DELAY,
    LinearSampledLoop,
    why_no_linear_loop,
)
from stickslip_ros.theory.requirements import ONE_MASS, covered, require
from stickslip_ros.theory.stability_map import CriticalGainCurves, StabilityMap

_UNSTABLE = "#E4E4E4"
_GAINS: Any = {"color": "white", "mec": "black", "marker": "*", "ls": "", "zorder": 5.0}
_LIMIT: Any = {"color": ORANGE, "lw": 2.0}
_CONTINUOUS: Any = {"color": "black", "ls": "--", "lw": 1.2}
_FORCE: Any = {"color": "black", "ls": (0, (5.0, 1.0, 1.0, 1.0)), "lw": 1.4}
_BEYOND_LIMIT_HATCH = "//"
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

_DASHED: Any = {"ls": (0, (4.0, 2.0))}
_WIDTHS = {Regime.EQUILIBRIUM: 1.8, Regime.STICK_SLIP: 2.4, Regime.PURE_SLIP: 1.2}
"""Widths of branches differ, too, so that colour is not the only distinction."""
_CYCLES = {Regime.STICK_SLIP: True, Regime.PURE_SLIP: False}
"""Whether the slide sticks in a limit cycle."""
_POINT: Any = {"marker": "o", "ms": 5.0, "ls": "", "color": "white", "mec": "black", "zorder": 4.0}
_FOLD: Any = {**_POINT, "marker": "D", "ms": 4.0}
_NOW: Any = {"color": GREY, "lw": 3.0, "alpha": 0.6, "zorder": 1.0}
_ONSET: Any = {"color": "black", "lw": 0.8, "ls": DASHES[2], "zorder": 1.5}
_BORDER: Any = {"color": "black", "lw": 0.5, "ls": DASHES[1], "zorder": 1.5}

_SAME_MARK_DISTANCE = 1e-3
"""Relative distance of two belt speeds below which one mark serves for both."""


def why_no_figure(scenario: Scenario) -> str | None:
    """Return why there is no figure; None if there is one.

    A map needs a linear sampled loop, the bifurcation diagram without control a drive that the
    search for limit cycles covers.
    """
    plant, law = scenario.plant, scenario.control_law
    if law is None:
        return covered(lambda: require_branches(plant.as_drive()))[1]
    drive = plant.as_drive()
    no_loop = why_no_linear_loop(drive, *plant.linear_sampling)
    _, no_map = covered(lambda: require("the stability map", drive, ONE_MASS))
    return no_loop or why_no_gains(law) or no_map


def scenario_stability_figure(scenario: Scenario, *, style: FigureStyle = SCREEN) -> Figure:
    """Return the map of a scenario with control, the bifurcation diagram of one without.

    Call it only if `why_no_figure` returns None.
    """
    if scenario.control_law is None:
        branches = BifurcationBranches.around(scenario.plant.as_drive())
        title = title_of("Bifurcation diagram", scenario, ["plant.belt_speed"])
        return branches_figure(branches, title=title, style=style)
    plant = scenario.plant
    drive, gains = plant.as_drive(), gains_of(scenario.control_law)
    loop = LinearSampledLoop.from_drive(drive, *plant.linear_sampling)
    assert loop is not None
    assert gains is not None
    rates = plant.control_rate * np.array((0.1, 0.3, 1.0))
    latest = min(0.2 * drive.natural_period, LONGEST_DELAY / rates.max())
    delays = np.linspace(0.0, latest, 41)
    sampling = rates, delays, plant.sensor, plant.answer_every
    curves = CriticalGainCurves.over(drive, gains.corner_frequency, *sampling)
    title = title_of("Stability of the sampled loop", scenario)
    return stability_figure(StabilityMap.around(loop, gains), curves, title=title, style=style)


@styled
def stability_figure(
    chart: StabilityMap,
    critical: CriticalGainCurves | None,
    *,
    title: str = "",
    style: FigureStyle = SCREEN,
) -> Figure:
    """Return the figure of the map and, if given, of the critical gains over the delay."""
    figure = style.figure(*((6.4, 5.8) if critical is None else (12.0, 5.6)), narrow=2.0)
    _set_title(figure, title, chart, style)
    count = 1 if critical is None else 2
    shape = (count, 1) if style.narrow else (1, count)
    panels = figure.subplots(*shape, squeeze=False).ravel()
    handles = _draw_map(figure, panels[0], chart)
    if critical is not None:
        _draw_critical_gains(panels[1], critical, chart)
    style.legend_below(figure, handles, most=4)
    finish(figure)
    return figure


@styled
def design_figure(design: Design, *, style: FigureStyle = SCREEN) -> Figure:
    """Return the map around a proposal, with the force limit; there must be a proposal."""
    around, scenario = design.map_around(), design.scenario
    assert around is not None
    assert scenario is not None
    figure = style.figure(6.8, 6.2, narrow=1.2)
    what, (low, high) = "Designed gains", design.task.belt_speeds
    if low != high:
        ends = Units.for_drive(design.task.drive).texts([low, high], "m/s")
        what += f" for {' to '.join(ends)}"
    title = title_of(what, scenario, _PROPOSED)
    _set_title(figure, title, around, style, " (slowest to settle)" * (low != high))
    axes = figure.subplots()
    handles = _draw_map(figure, axes, around)
    forces = design.peak_forces(around)
    handles += _draw_forces(axes, around, forces, design.task.force_limit)
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


def _set_title(
    figure: Figure, title: str, chart: StabilityMap, style: FigureStyle, which: str = ""
) -> None:
    """Set the title with the loop of a map; `which` of several it is."""
    loop = chart.loop
    units = Units.for_drive(loop.drive)
    belt, rate = units.text(loop.drive.belt_speed, "m/s"), units.text(loop.rate, "Hz")
    late = units.text(loop.force_delay, "s")
    delay = f", force delay {late}" if loop.force_delay > 0.0 else ""
    values = f"belt speed {belt}{which}, sample rate {rate}{delay}"
    style.set_title(figure, *([title] if title else []), values)


def _draw_map(figure: Figure, axes: Axes, chart: StabilityMap) -> list[Artist]:
    """Draw the decay rates; return the entries of the legend."""
    corners, gains, rates = chart.corner_frequencies, chart.linear_gains, chart.decay_rates.T
    units = Units.for_drive(chart.loop.drive)
    axes.grid(visible=False)
    axes.set_facecolor(_UNSTABLE)
    fastest = float(rates.max())
    if fastest > 0.0:
        levels = MaxNLocator(8, steps=_STEPS).tick_values(0.0, fastest)
        filled = axes.contourf(corners, gains, rates, levels=levels, cmap="viridis")
        figure.colorbar(filled, ax=axes, label=units.label("decay rate", "1/s"), ticks=levels)
        axes.contour(corners, gains, rates, levels=[0.0], colors=[ORANGE], linewidths=2.0)
    axes.plot(corners, chart.continuous, **_CONTINUOUS)
    axes.plot(chart.gains.corner_frequency, chart.gains.linear_gain, **_GAINS, ms=14)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xscale("log")
    axes.set_xlim(corners[0], corners[-1])
    axes.set_ylim(gains[0], gains[-1])
    axes.set_xlabel(units.label(units.named("cutoff frequency"), "rad/s"))
    axes.set_ylabel(units.label(units.named("linear gain"), "N s/m"))
    for stable, name in ((rates > 0.0, "stable"), (rates < 0.0, "unstable")):
        place = _roomiest(stable, chart)
        if place is not None:
            colour, stroke = ("white", "black") if name == "stable" else (INK, "white")
            axes.text(
                *place, name, color=colour, ha="center", va="center",
                path_effects=[withStroke(linewidth=1.5, foreground=stroke)],
            )  # fmt: skip
    unstable = bool((rates < 0.0).any())
    continuous = (chart.continuous >= gains[0]) & (chart.continuous <= gains[-1])
    visible = {
        Line2D([], [], **_LIMIT, label="limit of stability, sampled"): unstable and fastest > 0.0,
        Line2D([], [], **_CONTINUOUS, label="limit of stability, continuous"): continuous.any(),
        Line2D([], [], **_GAINS, ms=10, label="gains"): True,
        Patch(facecolor=_UNSTABLE, edgecolor=GREY, label="unstable"): unstable,
    }
    return [handle for handle, shown in visible.items() if shown]


def _roomiest(shown: BoolArray, chart: StabilityMap) -> tuple[float, float] | None:
    """Return the middle of the most room among the cells that are shown; None if there is little.

    The gains, and the edges of the map, are in the way of a text there.
    """
    from scipy.ndimage import distance_transform_edt  # importing it takes long

    columns, rows = len(chart.corner_frequencies), len(chart.linear_gains)
    free = shown.copy()
    column = int(np.abs(np.log(chart.corner_frequencies / chart.gains.corner_frequency)).argmin())
    row = int(np.abs(chart.linear_gains - chart.gains.linear_gain).argmin())
    width, height = columns // 12, rows // 16
    free[max(row - height, 0) : row + height + 1, max(column - width, 0) : column + width + 1] = 0
    # A text is three times as wide as high.
    distances: Any = distance_transform_edt(np.pad(free, 1), sampling=(3.0, 1.0))
    best = np.unravel_index(int(distances.argmax()), distances.shape)
    if distances[best] < columns / 9.0:
        return None
    return (
        float(chart.corner_frequencies[int(best[1]) - 1]),
        float(chart.linear_gains[int(best[0]) - 1]),
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
        look: Any = {"colors": "none", "hatches": [_BEYOND_LIMIT_HATCH]}
        axes.contourf(corners, gains, forces.T, levels=[limit, np.inf], **look)
    for colour, width, dashes in (("white", 3.0, "-"), ("black", _FORCE["lw"], [_FORCE["ls"]])):
        look = {"levels": levels, "colors": colour, "linewidths": width, "linestyles": dashes}
        drawn = axes.contour(corners, gains, forces.T, **look)
        if colour == "black" and not limited:
            names = {level: units.text(level, "N") for level in levels}
            texts = axes.clabel(drawn, fmt=names, fontsize=7.0)
            for text in texts:
                text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    if not limited:
        return [Line2D([], [], **_FORCE, label="largest force at switch-on")]
    shown = units.text(limit, "N")
    hatched = Patch(facecolor="white", edgecolor=INK, lw=0.0, hatch=_BEYOND_LIMIT_HATCH)
    hatched.set_label("needs a larger force")
    return [Line2D([], [], **_FORCE, label=f"force limit {shown}"), hatched]


def _draw_critical_gains(axes: Axes, critical: CriticalGainCurves, chart: StabilityMap) -> None:
    units = Units.for_drive(chart.loop.drive)
    late, label = units.axis("force delay", "s", critical.force_delays)
    axes.set_xlabel(label)
    for index, (rate, gains) in enumerate(zip(critical.rates, critical.linear_gains, strict=True)):
        look = _LOOKS[index % len(_LOOKS)]
        # At a change of sign the curve jumps from one interval of gains to another.
        jumps = np.flatnonzero(gains[:-1] * gains[1:] < 0.0) + 1
        delays = np.insert(critical.force_delays, jumps, np.nan)
        label = units.text(float(rate), "Hz")
        width, label = (2.8, f"{label}, this loop") if rate == chart.loop.rate else (1.2, label)
        axes.plot(delays / late, np.insert(gains, jumps, np.nan), **look, lw=width, label=label)
    axes.axhline(0.0, color=GREY, lw=0.8)
    here = chart.loop.force_delay / late, chart.gains.linear_gain
    axes.plot(*here, **_GAINS, ms=14, clip_on=False)
    axes.set_ylabel(units.label(units.named("critical linear gain"), "N s/m"))
    corner = chart.gains.corner_frequency
    axes.set_title(f"cutoff frequency {corner:.3g}{'' if units.dimensionless else ' rad/s'}")
    axes.margins(x=0.04)
    limits = axes.get_ylim()
    for row in np.flatnonzero(critical.rates == chart.loop.rate).tolist():
        ends, line = (critical.linear_gains[row], critical.other_ends[row]), axes.lines[row]
        axes.fill_between(critical.force_delays / late, *ends, color=line.get_color(), alpha=0.2)
        axes.collections[-1].set_label("stable, this loop")
    axes.set_ylim(limits)
    axes.legend(title="sample rate")


@styled
def branches_figure(
    diagram: BifurcationBranches, *, title: str, style: FigureStyle = SCREEN
) -> Figure:
    """Return the bifurcation diagram of a drive without control.

    Lines are solid where the motion is stable and dashed where it is not. A limit cycle has two
    lines, its least and its greatest displacement. Above each range of belt speeds stands the
    motion that the drive settles to. The drive's own belt speed is marked.
    """
    figure = style.figure(8.0, 5.6, narrow=1.15)
    style.set_title(figure, title)
    axes = figure.subplots()
    units = Units.for_drive(diagram.drive)
    branches = [*diagram.equilibria, *diagram.cycles]
    every = [edge for branch in branches for edge in (branch.least, branch.greatest)]
    length, y_label = units.axis(units.named("displacement"), "m", *every)
    speed, x_label = units.axis(units.named("belt speed"), "m/s", diagram.belt_speeds)
    handles = _draw_branches(axes, diagram, length, speed)
    speeds = np.concatenate([branch.belt_speeds for branch in diagram.equilibria])
    rests = np.concatenate([branch.least for branch in diagram.equilibria])
    for point in diagram.hopf_points:
        rest = np.interp(point.belt_speed, speeds, rests)
        label = f"critical feed speed (Hopf) {units.text(point.belt_speed, 'm/s')}"
        handles += axes.plot(point.belt_speed / speed, rest / length, **_POINT, label=label)
    onset, belt_speed = diagram.sticking_onset, diagram.drive.belt_speed
    for fold in diagram.folds:
        name = "fold"
        if onset is not None and isclose(fold, onset, rel_tol=_SAME_MARK_DISTANCE):
            name, onset = "fold, stick-slip onset speed", None
        for branch in diagram.cycles:
            for end in (0, -1):
                if branch.belt_speeds[end] == fold:
                    ends = branch.least[end] / length, branch.greatest[end] / length
                    axes.plot([fold / speed] * 2, ends, **_FOLD)
        handles.append(Line2D([], [], **_FOLD, label=f"{name} {units.text(fold, 'm/s')}"))
    if onset is not None:
        label = f"stick-slip onset speed {units.text(onset, 'm/s')}"
        handles.append(axes.axvline(onset / speed, **_ONSET, label=label))
    if belt_speed != 0.0:
        label = f"belt speed of the drive {units.text(belt_speed, 'm/s')}"
        handles.append(axes.axvline(belt_speed / speed, **_NOW, label=label))
    low, high = diagram.belt_speeds[[0, -1]].tolist()
    axes.set_xlim(min(low, belt_speed, 0.0) / speed, max(high, belt_speed, 0.0) / speed)
    axes.set(xlabel=x_label, ylabel=y_label)
    finish(figure)
    style.legend_below(figure, handles, most=3)
    _name_regions(figure, axes, diagram, speed)
    return figure


def _draw_branches(
    axes: Axes, diagram: BifurcationBranches, length: float, speed: float
) -> list[Artist]:
    """Draw equilibria and limit cycles; return the entries of the legend."""
    looks: dict[str, dict[str, Any]] = {}
    for branch in diagram.equilibria:
        name, look = _look(branch, Regime.EQUILIBRIUM)
        looks[name] = look
        axes.plot(branch.belt_speeds / speed, branch.least / length, **look)
    for branch in diagram.cycles:
        looks |= (
            _look(branch, regime) for regime in _CYCLES if (branch.sticks == _CYCLES[regime]).any()
        )
        for edge in (branch.least, branch.greatest):
            for regime in reversed(_CYCLES):
                rows = branch.sticks == _CYCLES[regime]
                # With the row before them, so that lines in turn leave no gap.
                shown = np.where(rows | np.append(rows[1:], False), edge, np.nan)
                _, look = _look(branch, regime)
                axes.plot(branch.belt_speeds / speed, shown / length, **look)
    return [Line2D([], [], **look, label=name) for name, look in looks.items()]


def _look(branch: Branch, regime: Regime) -> tuple[str, dict[str, Any]]:
    """Return the name of a branch, where it has that regime, and the look of its line."""
    look: dict[str, Any] = {"color": REGIMES[regime].colour, "lw": _WIDTHS[regime]}
    name = "equilibrium" if regime is Regime.EQUILIBRIUM else Regime.label(regime)
    return (f"{name}, stable", look) if branch.stable else (f"{name}, unstable", look | _DASHED)


def _regions(diagram: BifurcationBranches) -> Iterator[tuple[float, float, str]]:
    """Yield ranges of belt speeds with the motions that the drive settles to."""
    low, high = diagram.belt_speeds[[0, -1]].tolist()
    onset = [] if diagram.sticking_onset is None else [diagram.sticking_onset]
    edges = [point.belt_speed for point in diagram.hopf_points] + diagram.folds + onset
    start, before = low, ""
    for left, right in pairwise([low, *sorted(edges), high]):
        name = _settles(diagram, (left + right) / 2.0)
        if left > start and name != before:
            yield start, left, before
            start = left
        before = name
    yield start, high, before


def _settles(diagram: BifurcationBranches, belt_speed: float) -> str:
    """Return the stable motions at a belt speed."""
    motions: dict[str, None] = {}
    for branches, rests in ((diagram.cycles, False), (diagram.equilibria, True)):
        for branch in branches:
            speeds = branch.belt_speeds
            if branch.stable and speeds[0] <= belt_speed <= speeds[-1]:
                nearest = int(np.abs(speeds - belt_speed).argmin())
                cycle = Regime.STICK_SLIP if branch.sticks[nearest] else Regime.PURE_SLIP
                motions["steady sliding" if rests else Regime.label(cycle)] = None
    return " or ".join(motions)


def _name_regions(figure: Figure, axes: Axes, diagram: BifurcationBranches, speed: float) -> None:
    """Write above each range of belt speeds what the drive settles to, upright if it is narrow."""
    points = 8.0
    figure.draw_without_rendering()
    box = axes.get_window_extent()
    width, height = box.width / figure.dpi, box.height / figure.dpi
    left, right = axes.get_xlim()
    line, deepest = 1.5 * points / 72.0, 0.0
    for start, end, name in _regions(diagram):
        room = width * (end - start) / speed / (right - left)
        written = text_width(name, points)
        upright = written > 0.95 * room
        if end != diagram.belt_speeds[-1]:
            axes.axvline(end / speed, **_BORDER)
        if not name or (upright and room < line):
            continue
        deepest = max(deepest, written if upright else line)
        axes.annotate(
            name, ((start + end) / 2.0 / speed, 1.0), (0.0, -3.0),
            xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=points,
            ha="center", va="top", rotation=90.0 if upright else 0.0,
        )  # fmt: skip
    bottom, top = axes.get_ylim()
    share = min((deepest + 0.1) / height, 0.6)
    axes.set_ylim(bottom, bottom + (top - bottom) / (1.0 - share))
