"""Drawing of runs on axes: traces over time, cycles, friction law, and analysis."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec, GridSpecFromSubplotSpec, SubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.mean_cycle import MeanCycle
from stickslip_ros.measures.run_meter import RunAnalysis
from stickslip_ros.measures.slips import Slip
from stickslip_ros.model.drive import Drive
from stickslip_ros.quantities import Quantity, quantities_of
from stickslip_ros.show import BLUE, GREEN, GREY, LIGHT_GREY, ORANGE
from stickslip_ros.show.quantities import MEASURES, Units
from stickslip_ros.show.run_history import DrawnMotion, RunHistory, intervals, peaks

MOTION: Any = {"color": BLUE, "lw": 1.0}
BELT: Any = {"color": "black", "lw": 1.0, "ls": "--", "zorder": 2.5}
POINT: Any = {"color": GREEN, "marker": "o", "ms": 6.0, "ls": "", "mec": "white"}
"""Looks of the slide, the belt and an equilibrium."""

PIXELS = 1000
"""Intervals of time across a panel, of about one pixel each."""

LEAST_SPAN = 1e-6
"""Smallest span of an axis, as a share of the largest value on it: less is rounding."""

LEAST_PART = 1e-3
"""Smallest span of an axis for a part of a motion, as a share of the span of all of it."""

HELD: Any = {"color": ORANGE, "lw": 1.2, "ls": ":", "drawstyle": "steps-post"}
"""Look of a force that is held because no new one came."""

_SHADE = LinearSegmentedColormap.from_list("stick", [to_rgba(GREY, 0.0), to_rgba(GREY, 0.6)])

_LAW: Any = {"color": "black", "lw": 0.8, "ls": "-."}
_REACHED: Any = {"color": LIGHT_GREY, "alpha": 0.4, "lw": 0.0}
DOTS: Any = {"marker": ".", "ms": 2.0, "ls": "", "alpha": 0.4, "mew": 0.0, "rasterized": True}
"""Look of samples; as vectors they would make a file of megabytes."""
_RAW: Any = DOTS | {"color": BLUE}
_FITTED: Any = {"color": ORANGE, "lw": 1.2}
_TIME = {False: "time within the cycle", True: "time"}
_CONFIDENCE = 1.96
"""Half of a 95 % interval, in standard errors."""
_EQUAL_SPREAD = 1e-9
"""Relative spread of slips below which they are shown as equal."""
_BINS = 30


class Pane(NamedTuple):
    """A section of the run over time."""

    title: str
    rows: DrawnMotion
    start: float
    end: float

    @classmethod
    def covering(cls, title: str, rows: DrawnMotion, *other: FloatArray) -> Self:
        """Return a pane that covers the rows and the other times."""
        times = [time for time in (rows.time, *other) if len(time)]
        if not times:
            return cls(title, rows, 0.0, 1.0)
        start, end = min(float(t[0]) for t in times), max(float(t[-1]) for t in times)
        return cls(title, rows, start, end if end > start else start + 1.0)


def draw_line(
    axes: Axes, pane: Pane, trace: Sequence[FloatArray], scale: float, gap: float, **look: Any
) -> None:
    """Draw a trace of time and values across a pane and slightly beyond, with every peak."""
    time, values = trace
    first, end = np.searchsorted(time, (pane.start, pane.end), "right")
    rows = slice(max(int(first) - 1, 0), int(end) + 1)
    time, values = time[rows], values[rows]
    length = (pane.end - pane.start) / PIXELS
    drawn = peaks(intervals(time, length), values)
    # No rows are missing between neighbouring intervals.
    time, values = broken(max(gap, 2.0 * length), time[drawn], values[drawn])
    axes.plot(time, values / scale, **look)


def with_edges(trace: Sequence[FloatArray], motion: DrawnMotion) -> list[FloatArray]:
    """Return a friction force at samples with its values where a stick begins and ends.

    There it is steepest: the nearest samples miss its extremes by another part of a period in each
    cycle, which looks like a beat. In a stick of three samples or more on a line it is that line.
    """
    time, force = trace
    stuck = np.diff(motion.stick_time) > 0.5 * np.diff(motion.time)
    change = np.diff(np.r_[0, stuck, 0])
    begins, ends = motion.time[np.flatnonzero(change > 0)], motion.time[np.flatnonzero(change < 0)]
    first, last = np.searchsorted(time, begins, "right"), np.searchsorted(time, ends) - 1
    long = last >= first + 2
    rows: list[FloatArray] = [time, force]
    for edges, row, step in ((begins[long], first[long], 1), (ends[long], last[long], -1)):
        a, b, c = force[row], force[row + step], force[row + 2 * step]
        slope = (b - a) / (time[row + step] - time[row])
        line = np.abs(a - 2.0 * b + c) < 0.1 * np.abs(b - a)
        added = edges[line], (a + slope * (edges - time[row]))[line]
        place = np.searchsorted(rows[0], added[0], "left" if step < 0 else "right")
        rows = [np.insert(column, place, more) for column, more in zip(rows, added, strict=True)]
    return rows


def draw_held(
    axes: Axes,
    pane: Pane,
    control: Sequence[FloatArray],
    scale: float,
    gap: float,
    dropped: FloatArray,
) -> bool:
    """Extend forces up to the next one after a gap; return whether there are any.

    If forces were `dropped` (times in s) in the gap, the acting force is unknown and not drawn.
    """
    time, force = control
    behind = np.flatnonzero(np.diff(time) > max(gap, 2.0 * (pane.end - pane.start) / PIXELS))
    came = np.diff(np.searchsorted(dropped, time)) > 0
    behind = behind[~came[behind]]
    behind = behind[(time[behind + 1] > pane.start) & (time[behind] < pane.end)]
    if len(behind) == 0:
        return False
    rows = np.stack([behind, behind + 1, behind + 1], axis=1).ravel()
    drawn = force[rows] / scale
    drawn[2::3] = np.nan
    axes.plot(time[rows], drawn, **HELD)
    return True


def panels_over_time(
    figure: Figure, part: SubplotSpec, quantities: int, panes: int, *, narrow: bool
) -> Any:
    """Return axes for so many quantities and panes; the first pane is the widest.

    If the figure is narrow, the first pane is above the others.
    """
    if not narrow:
        grid = part.subgridspec(quantities, panes, width_ratios=(2.0, *[1.0] * (panes - 1)))
        return grid.subplots(sharex="col", sharey="row")
    above, below = part.subgridspec(2, 1)
    whole: Any = above.subgridspec(quantities, 1).subplots(sharex=True, squeeze=False)
    others: Any = below.subgridspec(quantities, panes - 1).subplots(
        sharex="col", sharey="row", squeeze=False
    )
    panels = np.concatenate([whole, others], axis=1)
    for row in panels:
        row[1].sharey(row[0])
    return panels


def widened(low: float, high: float, least: float = 0.0) -> tuple[float, float]:
    """Return limits of an axis that span more than the rounding of its values, and `least`."""
    middle = (low + high) / 2.0
    half = max(high - low, least, LEAST_SPAN * max(abs(low), abs(high))) / 2.0
    return (low, high) if half == (high - low) / 2.0 else (middle - half, middle + half)


def broken(gap: float, time: FloatArray, *columns: FloatArray) -> list[FloatArray]:
    """Return the columns with a row of NaN between times further apart than `gap`."""
    behind = np.flatnonzero(np.diff(time) > gap) + 1
    return [np.insert(column, behind, np.nan) for column in (time, *columns)]


def draw_cycles(
    panels: Sequence[Axes],
    histories: Sequence[RunHistory],
    looks: Sequence[Mapping[str, Any]],
    units: Units,
    most: int,
) -> None:
    """Draw amplitude and stick fraction of each cycle over time, in a panel each.

    The markers of `looks` are on at most about `most` cycles of a run.
    """
    cycles = [history.cycles for history in histories]
    (amplitude, metre, _), fraction = MEASURES["amplitude"], MEASURES["stick_fraction"].label
    scale, label = units.axis(amplitude, metre, *(run[1] for run in cycles))
    if not any(len(time) for time, *_ in cycles):
        say(panels[0], "no cycle was completed")
    positions = [history.motion.position for history in histories]
    farthest = max(float(np.abs(position).max(initial=0.0)) for position in positions) / scale
    for axes, column, of_panel, size, least in (
        (panels[0], 1, label, scale, LEAST_SPAN * farthest),
        (panels[1], 2, fraction, 1.0, 0.0),
    ):
        for run, look in zip(cycles, looks, strict=False):
            time, values = run[0], run[column]
            told = ~np.isnan(values)
            if len(time) and not told.any():
                say(axes, "not known of single cycles")
                continue
            time, values = time[told], values[told]
            length = float(time[-1] - time[0]) / PIXELS if len(time) else 1.0
            rows = peaks(intervals(time, length or 1.0), values)  # in each pixel column
            every = max(1, len(rows) // most)
            axes.plot(time[rows], values[rows] / size, markevery=every, **look)
        largest = max(float(np.nanmax(run[column], initial=0.0)) / size for run in cycles)
        axes.set_ylim(0.0, max(1.1 * largest, least) or 1.0)
        axes.set_ylabel(of_panel)


def shade(axes: Axes, pane: Pane) -> None:
    """Shade each pixel column of a pane by the share of time in which the slide sticks."""
    bottom, top = axes.get_ylim()
    if len(pane.rows.time):
        edges = np.linspace(pane.start, pane.end, PIXELS + 1)
        stick_time = np.interp(edges, pane.rows.time, pane.rows.stick_time)
        share = np.diff(stick_time) / np.diff(edges)
        axes.imshow(
            share[np.newaxis], cmap=_SHADE, vmin=0.0, vmax=1.0, aspect="auto", zorder=0.0,
            extent=(pane.start, pane.end, bottom, top), interpolation="nearest",
        )  # fmt: skip
        axes.set_xlim(pane.start, pane.end)
        axes.set_ylim(bottom, top)


def label_axis(axis: XAxis | YAxis, scale: float, label: str) -> None:
    """Label an axis of values in SI with the divisor and the label of `Units.axis`."""
    axis.set_label_text(label)
    axis.set_major_formatter(lambda value, _: f"{value / scale:.10g}")


def say(axes: Axes, why: str) -> None:
    """Write in a panel why it is empty."""
    axes.text(0.5, 0.5, why, ha="center", va="center", transform=axes.transAxes)


def draw_law(
    axes: Axes, drive: Drive, history: RunHistory, last: DrawnMotion, units: Units, *, short: bool
) -> list[Artist]:
    """Draw the friction law with the range of relative speeds; return the entries of its legend.

    Friction with a memory leaves the curve of steady slip: its loop in the `last` cycles is drawn.
    """
    at_rest, reached = -drive.belt_speed, history.relative_speeds
    least, largest = reached or (min(at_rest, 0.0), max(at_rest, 0.0))
    ends = min(least, at_rest, 0.0), max(largest, at_rest, 0.0)
    room = 0.1 * (ends[1] - ends[0]) or drive.speed_scale
    ends = ends[0] - room, ends[1] + room
    relative_speed = units.named("velocity relative to the belt", short=short)
    scale, label = units.axis(relative_speed, "m/s", ends)
    axes.set(xlabel=label, ylabel=units.named("friction coefficient", short=short))
    _law_between(axes, drive, *ends, scale, **_LAW)
    if reached is not None:
        axes.axvspan(least / scale, largest / scale, **_REACHED)
    curve, followed = "friction law", list[Artist]()
    relative = last.velocity - last.belt_velocity
    if drive.friction.states:
        curve, followed = "in steady slip", [Line2D([], [], **MOTION, label="last cycles")]
        if len(relative):
            time, force = history.friction.since(float(last.time[0]))
            speed = np.interp(time, last.time, relative / scale)
            axes.plot(speed, force / drive.normal_force, label="loop", **MOTION)
    elif len(relative):
        span = float(relative.min()), float(relative.max())
        # A slide at rest has a point instead, but one that sticks any force of the stick.
        if span[1] - span[0] > LEAST_PART * (ends[1] - ends[0]) or span[0] <= 0.0 <= span[1]:
            look: Any = MOTION | {"lw": 3.0}
            _law_between(axes, drive, *span, scale, **look)
            followed.append(Line2D([], [], **look, label="range of the last cycles"))
    if at_rest != 0.0:
        rest = float(drive.friction.at_rest(drive.belt_speed))
        axes.plot(at_rest / scale, rest, zorder=3.0, **POINT)
    axes.axvline(at_rest / scale, **BELT)
    axes.set_xlim(ends[0] / scale, ends[1] / scale)
    return [
        Line2D([], [], **_LAW, label=curve),
        *followed,
        Patch(**_REACHED, label="range of the whole run"),
    ]


def _law_between(
    axes: Axes, drive: Drive, least: float, largest: float, scale: float, **look: Any
) -> None:
    law = drive.friction
    for sign, start, end in ((-1.0, least, min(largest, 0.0)), (1.0, max(least, 0.0), largest)):
        if start < end:
            # Closely spaced where the law may be steep.
            steps = np.r_[0.0, np.geomspace(1e-6, 1.0, 400)]
            speeds = start + (end - start) * steps
            if sign < 0.0:
                speeds = end - (end - start) * steps
            axes.plot(speeds / scale, law.coefficient(speeds, sign), **look)
    if least <= 0.0 <= largest:
        forward, backward = map(float, law.limits)
        axes.plot([0.0, 0.0], [-forward, backward], **look)


def draw_analysis(
    figure: Figure,
    part: GridSpec | GridSpecFromSubplotSpec,
    analysis: RunAnalysis,
    units: Units,
    *,
    short: bool,
) -> None:
    """Draw the mean cycle with its edges, or the distributions over the slips.

    `part` has three cells, beside each other or one above another. Labels may have to be `short`.
    """
    if analysis.slips is not None:  # they were asked for
        slips, shown = analysis.slips["each"], quantities_of(Slip)
        for column, name in enumerate(("stick_time", "drop", "slip_time")):
            values = np.array([value for value in slips[name] if value is not None])
            _distribution(figure.add_subplot(part[column]), values, shown[name], units)
    elif analysis.mean_cycle is not None:
        _cycle(figure.add_subplot(part[0:2]), analysis.mean_cycle, units, short=short)
        _residual(figure.add_subplot(part[2]), analysis.mean_cycle, units, short=short)


def _cycle(axes: Axes, mean: MeanCycle, units: Units, *, short: bool) -> None:
    scale, label = units.axis(units.named("displacement", short=short), "m", mean.position)
    second, time_label = units.axis(_TIME[short], "s", mean.phase)
    order = np.argsort(mean.phase)
    raw: Any = _RAW | {"ms": 6.0}  # wider than the line
    axes.plot(mean.phase / second, mean.position / scale, **raw, label="measured, all cycles")
    axes.plot(mean.phase[order] / second, mean.fitted[order] / scale, **_FITTED, label="fitted")
    if mean.stick is not None:
        period, fit = mean.cycle.period, mean.stick.fit
        edges = (fit.landing, fit.departure), mean.stick.edge_errors
        named = zip(("landing", "departure"), *edges, strict=True)
        for line, (name, edge, error) in enumerate(named):
            at, half = edge % period / second, _CONFIDENCE * error / second
            axes.axvspan(at - half, at + half, color=GREY, alpha=0.6, lw=0.0)
            axes.axvline(at, color="black", lw=0.8, ls="--")
            axes.annotate(
                f"{name} ± {units.text(_CONFIDENCE * error, 's')}", (at, 0.0),
                (3.0, 3.0 + 11.0 * line), xycoords=("data", "axes fraction"),
                textcoords="offset points", fontsize="small",
            )  # fmt: skip
    axes.set_xlabel(time_label)
    axes.set(ylabel=label, title="mean cycle" if short else "mean cycle; edges with 95 % intervals")
    axes.legend(loc="upper right", fontsize="small")


def _residual(axes: Axes, mean: MeanCycle, units: Units, *, short: bool) -> None:
    residual = mean.position - mean.fitted
    scale, label = units.axis("residual", "m", residual)
    second, time_label = units.axis(_TIME[short], "s", mean.phase)
    axes.plot(mean.phase / second, residual / scale, **_RAW)
    axes.set(xlabel=time_label, ylabel=label, title=f"noise {units.text(mean.noise, 'm')}")


def _distribution(axes: Axes, values: FloatArray, quantity: Quantity, units: Units) -> None:
    scale, label = units.axis(quantity.label, quantity.unit, values)
    if len(values):
        shown = values / scale
        low, high = shown.min(), shown.max()
        if high - low < _EQUAL_SPREAD * high:  # too close for bins of their own
            low, high = low - 0.5, high + 0.5
        axes.hist(shown, bins=_BINS, range=(low, high), color=BLUE)
        axes.axvline(float(np.median(values)) / scale, color=ORANGE, lw=1.2, label="median")
        axes.legend(fontsize="small")
    axes.set(xlabel=label, ylabel="slips", title=f"{len(values)} slips")
