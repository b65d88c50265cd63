"""Panels over time: a part of a run, its traces with every peak, and when the slide sticks."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgba

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_measures import Measures, with_trend
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.plots.decimation import intervals, peaks
from stickslip_ros.plots.regimes import REGIMES
from stickslip_ros.plots.run_history import DrawnMotion
from stickslip_ros.plots.style import GREY
from stickslip_ros.plots.units import Units

LAST_CYCLES = 5
"""Number of cycles that are enlarged, and in the phase portrait."""

PIXELS = 1000
"""Intervals of time across a panel, of about one pixel each."""

LEAST_SPAN = 1e-6
"""Smallest span of an axis, as a share of the largest value on it: less is rounding."""

LEAST_PART = 1e-3
"""Smallest span of an axis for a part of a motion, as a share of the span of all of it."""

_SHADE = LinearSegmentedColormap.from_list("stick", [to_rgba(GREY, 0.0), to_rgba(GREY, 0.6)])


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


def measures_text(measures: Measures, units: Units) -> str:
    """Return regime, amplitude, frequency and stick fraction as a line of text."""
    found = [with_trend(REGIMES[measures.regime].label, measures.trend)]
    for name, value, unit in (
        ("amplitude", measures.amplitude, "m"),
        ("frequency", measures.frequency, "Hz"),
        ("stick fraction", measures.stick_fraction, ""),
    ):
        if value is not None and measures.period is not None:
            found.append(f"{name} {units.text(value, unit)}")
    return ", ".join(found)


def end_duration(motion: DrawnMotion, measures: Measures, drive: Drive | None) -> float:
    """Return the duration of the enlarged end, s; a fixed share of the run without a period."""
    span = float(motion.time[-1] - motion.time[0]) if len(motion.time) else 0.0
    natural = drive.natural_period if drive is not None and drive.has_spring else 0.0
    period = measures.period or natural
    return min(LAST_CYCLES * period, span) or 0.05 * span


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


def widened(low: float, high: float, least: float = 0.0) -> tuple[float, float]:
    """Return limits of an axis that span more than the rounding of its values, and `least`."""
    middle = (low + high) / 2.0
    half = max(high - low, least, LEAST_SPAN * max(abs(low), abs(high))) / 2.0
    return (low, high) if half == (high - low) / 2.0 else (middle - half, middle + half)


def broken(gap: float, time: FloatArray, *columns: FloatArray) -> list[FloatArray]:
    """Return the columns with a row of NaN between times further apart than `gap`."""
    behind = np.flatnonzero(np.diff(time) > gap) + 1
    return [np.insert(column, behind, np.nan) for column in (time, *columns)]


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


def say(axes: Axes, why: str) -> None:
    """Write in a panel why it is empty."""
    axes.text(0.5, 0.5, why, ha="center", va="center", transform=axes.transAxes)
