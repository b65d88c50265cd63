"""History of a run, reduced to the points that its figure needs, with every peak."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray, median
from stickslip_ros.measures.cycle_measures import Measures
from stickslip_ros.measures.run_meter import RunAnalysis
from stickslip_ros.measures.sample_meter import MeasuredMotion
from stickslip_ros.measures.sampling_grid import LONGEST_GAP
from stickslip_ros.model.drive import Drive
from stickslip_ros.samples import LARGEST
from stickslip_ros.show.quantities import Units

LAST_CYCLES = 5
"""Number of cycles that are enlarged, and in the phase portrait."""

_FIRST_ROWS = 20_000
"""Rows of the start that are kept unchanged, for a phase portrait."""

_SWITCHED_ROWS = 20_000
"""Rows from the first force on that are kept unchanged, and as much time before."""


def peaks(bucket: IntArray, *columns: FloatArray) -> IntArray:
    """Return the rows to draw: of each bucket the first, the last, and each column's extremes.

    `bucket` is the ascending bucket number of each row. If the buckets are the pixel columns of a
    figure, it looks the same as with all rows. The returned rows ascend. NaN is not an extreme.
    """
    if not len(bucket):
        return np.empty(0, dtype=np.int64)
    begin = np.flatnonzero(np.r_[True, bucket[1:] != bucket[:-1]])
    size = np.diff(np.r_[begin, len(bucket)])
    end = begin + size
    kept = [begin, end - 1]
    if int(size.max()) > 2:
        for column in columns:
            for extreme in (np.fmin, np.fmax):
                reached = column == np.repeat(extreme.reduceat(column, begin), size)
                # The first in each bucket; beyond its end where it has no numbers.
                rows = np.append(np.flatnonzero(reached), len(bucket))
                first = rows[np.searchsorted(rows, begin)]
                kept.append(first[first < end])
    return np.unique(np.concatenate(kept))


class Trace:
    """Columns over time that arrive in blocks, kept in a bounded number of rows to draw.

    Excess rows are thinned to the peaks of short intervals, each a small part of a pixel column.
    The last rows are kept unchanged. Times are in s, or stamps in ns.
    """

    _MOST_THINNED = 150_000
    _LEAST_INTERVALS = 10_000
    _LAST_ROWS = 50_000

    def __init__(self, columns: int, time: type[np.float64 | np.int64] = np.float64) -> None:
        """Prepare for blocks of a time of that type and `columns` columns."""
        self._kept: list[NDArray[Any]] = [np.empty(0, time), *[np.empty(0)] * columns]
        self._size = self._thinned = 0
        """Number of filled rows, and how many of them may be thinned."""
        self._latest = -float("inf")
        self.interval = 0.0
        """Longest time between rows that results from thinning."""

    def __len__(self) -> int:
        return self._size

    @property
    def last(self) -> list[float]:
        """Time and columns of the last row; a time of minus infinity if there is none."""
        if not self._size:
            return [-float("inf")] + [0.0] * (len(self._kept) - 1)
        return [float(kept[self._size - 1]) for kept in self._kept]

    def later(self, time: FloatArray) -> BoolArray:
        """Return which of the times that follow are later than all those before."""
        later = time > np.maximum.accumulate(np.append(self._latest, time))[:-1]
        self._latest = float(time.max(initial=self._latest))
        return later

    def add(self, time: NDArray[Any], *columns: FloatArray) -> None:
        """Append rows, in ascending order of time."""
        size = self._size + len(time)
        if size > len(self._kept[0]):
            self._keep(slice(0, self._size), 2 * size)
        for kept, column in zip(self._kept, (time, *columns), strict=True):
            kept[self._size : size] = column
        self._size = size
        if size - self._thinned > 2 * self._LAST_ROWS:
            self._thinned = size - self._LAST_ROWS
            if self._thinned > self._MOST_THINNED:
                self._thin()

    def forget(self, end: float) -> None:
        """Remove rows before a time, but none of the last 50,000, once they are half of all."""
        first = int(np.searchsorted(self._kept[0][: self._size], end))
        first = min(first, self._size - self._LAST_ROWS)
        if 2 * first > self._size:
            self._thinned = max(self._thinned - first, 0)
            self._keep(slice(first, self._size), 2 * (self._size - first))

    def columns(self) -> list[NDArray[Any]]:
        """Return time and columns of all rows; valid until rows are added."""
        return [kept[: self._size] for kept in self._kept]

    def since(self, start: float) -> list[NDArray[Any]]:
        """Return the same from `start` on without thinning, of the last 50,000 rows or more."""
        first = int(np.searchsorted(self._kept[0][: self._size], start))
        return [kept[max(first, self._thinned) : self._size] for kept in self._kept]

    def _thin(self) -> None:
        time, *columns = (kept[: self._thinned] for kept in self._kept)
        interval = self.interval or float(time[-1] - time[0]) / self._LEAST_INTERVALS or 1.0
        rows = np.arange(self._thinned)
        while len(rows) > self._MOST_THINNED // 2:
            # A doubled interval contains whole earlier ones, and the larger of their peaks.
            kept = peaks(intervals(time[rows], interval), *(column[rows] for column in columns))
            rows, self.interval = rows[kept], interval
            interval *= 2.0
        rows = np.append(rows, np.arange(self._thinned, self._size))
        self._thinned = len(rows) - self._LAST_ROWS
        self._keep(rows, 2 * len(rows))

    def _keep(self, rows: slice | IntArray, room: int) -> None:
        """Keep these rows only, with space for `room` rows."""
        kept = [column[rows] for column in self._kept]
        self._size = len(kept[0])
        self._kept = [np.resize(column, room) for column in kept]


def intervals(time: NDArray[Any], length: float) -> IntArray:
    """Return the number of the interval of that length that contains each time."""
    return np.floor(time / length).astype(np.int64)


class DrawnMotion(NamedTuple):
    """Breakpoints, all or a part, as columns; SI units."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt_velocity: FloatArray
    stick_time: FloatArray
    """Total stick time of the slide until then, s."""


class RunHistory:
    """Observer of a run that keeps its history in constant memory.

    All values are in SI units. Data whose time does not increase are omitted.
    """

    def __init__(self) -> None:
        self.left_out = 0
        """Number of samples whose time did not increase."""
        self.gap = float("inf")
        """Time between two rows, s, above which the motion between them is unknown."""
        self.control_gap = float("inf")
        """The same for two control forces, s."""
        self.relative_speeds: tuple[float, float] | None = None
        """Smallest and largest velocity relative to the belt, m/s; None without a motion."""
        self.friction = Trace(1)
        """Friction force on the slide, N."""
        self.control = Trace(1)
        """Force (N) over the time from which it acts or is requested."""
        self.dropped = Trace(1)
        """Force (N) that was requested and did not act, as far as known."""
        self.motor = Trace(4)
        """Displacement (m) and velocity (m/s) of the slide, then of a motor of finite mass."""
        self.switched_on: float | None = None
        """Time of the first force that is not zero, s; None as long as there is none."""
        self.analysis = RunAnalysis(None, None)
        """Analysis of the record."""
        self._motion, self._cycles = Trace(4), Trace(2)
        self._first: list[DrawnMotion] = []
        self._first_rows = 0
        self._switched: DrawnMotion | None = None

    @property
    def motion(self) -> DrawnMotion:
        """The whole motion; a long one is thinned to its peaks."""
        return DrawnMotion(*self._motion.columns())

    @property
    def beginning(self) -> DrawnMotion:
        """The start of the motion without thinning, about 20,000 rows."""
        if not self._first:
            return DrawnMotion(*[np.empty(0)] * 5)
        return DrawnMotion(*map(np.concatenate, zip(*self._first, strict=True)))

    def end(self, duration: float) -> DrawnMotion:
        """Return the last `duration` (s) of the motion, of the 50,000 last rows or more."""
        return DrawnMotion(*self._motion.since(self._motion.last[0] - duration))

    def around_switch_on(self, before: float, after: float) -> DrawnMotion:
        """Return the motion from `before` to `after` (s) the first force that is not zero."""
        assert self.switched_on is not None
        rows = self._switched or self.motion
        start, end = self.switched_on - before, self.switched_on + after
        shown = (rows.time >= start) & (rows.time <= end)
        return DrawnMotion(*(column[shown] for column in rows))

    @property
    def cycles(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """End time (s) of each cycle, its amplitude (m) and its stick fraction."""
        time, amplitude, stick_fraction = self._cycles.columns()
        return time, amplitude, stick_fraction

    def take_analysis(self, analysis: RunAnalysis) -> None:
        """Keep the analysis of the whole run."""
        self.analysis = analysis

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Add the next part of the motion."""
        self._take_cycles(motion)
        time = motion.breakpoints.time
        if len(time) == 0:
            return
        if self.gap == float("inf"):
            self.gap = motion.longest_step
        # Breakpoints may share an instant; a step back in time is larger.
        end, *_, stick_time = self._motion.last
        rows = (time > end) | (time[0] >= end)
        breakpoints, belt_velocity = motion.breakpoints[rows], motion.belt_velocity[rows]
        if len(breakpoints) == 0:
            return
        time = breakpoints.time
        steps = np.diff(time, prepend=end if self._first else time[0])
        stuck = stick_time + np.cumsum(np.where(breakpoints.sticking, steps, 0.0))
        drawn = DrawnMotion(time, breakpoints.position, breakpoints.velocity, belt_velocity, stuck)
        self._motion.add(*drawn)
        self._keep_switch_on()
        if self._first_rows < _FIRST_ROWS:
            self._first.append(drawn)
            self._first_rows += len(time)
        relative = breakpoints.velocity - belt_velocity
        least, largest = self.relative_speeds or (np.inf, -np.inf)
        low, high = float(relative.min()), float(relative.max())
        self.relative_speeds = min(least, low), max(largest, high)

    def _keep_switch_on(self) -> None:
        """Keep the motion around the first force once there is enough of it."""
        if self.switched_on is None or self._switched is not None:
            return
        if len(self._motion.since(self.switched_on)[0]) > _SWITCHED_ROWS:
            kept = self._motion.since(2.0 * self.switched_on - self._motion.last[0])
            self._switched = DrawnMotion(*(column.copy() for column in kept))

    def _take_cycles(self, motion: MeasuredMotion) -> None:
        time = np.array(motion.cycle_ends)
        columns = np.array([(c.amplitude, c.stick_fraction) for c in motion.cycles])
        later = self._cycles.later(time)
        self._cycles.add(time[later], *columns.reshape(-1, 2)[later].T)

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        """Add the friction force at the next samples; unknown values are omitted."""
        later = self.friction.later(time)
        self.left_out += int((~later).sum())
        rows = later & (np.abs(force) <= LARGEST)
        self.friction.add(time[rows], force[rows])

    def take_motor(self, time: FloatArray, states: FloatArray) -> None:
        """Add the states of slide and motor at the next samples."""
        rows = self.motor.later(time) & np.all(np.abs(states) <= LARGEST, axis=0)
        self.motor.add(time[rows], *states[:, rows])

    def take_control(self, time: FloatArray, force: FloatArray, acted: BoolArray) -> None:
        """Add the next control forces, with the time from which each acts or is requested."""
        rows = self.control.later(time) & np.isfinite(force)
        if self.control_gap == float("inf") and rows.sum() > 1:
            self.control_gap = LONGEST_GAP * median(np.diff(time[rows]))
        acting = np.flatnonzero(rows & acted & (force != 0.0))
        if self.switched_on is None and len(acting):
            self.switched_on = float(time[acting[0]])
        for trace, drawn in ((self.control, rows & acted), (self.dropped, rows & ~acted)):
            trace.add(time[drawn], force[drawn])


class DrawnRun(NamedTuple):
    """A run to draw."""

    name: str
    """Name beside other runs."""
    history: RunHistory
    measures: Measures
    drive: Drive | None
    """None if it is unknown."""
    notes: Sequence[str] = ()
    """Sentences on the run, shown below the title."""
    title: str = ""
    disturbed: bool = False
    """Whether a disturbance is added to the control force."""
    rotary: bool = False
    """Whether the displacement is an angle."""

    @property
    def units(self) -> Units:
        """Units in which the run is shown."""
        return Units.for_drive(self.drive, rotary=self.rotary)

    @property
    def last_cycles(self) -> DrawnMotion:
        """The last `LAST_CYCLES` cycles; without a period a fixed share of the run."""
        time = self.history.motion.time
        span = float(time[-1] - time[0]) if len(time) else 0.0
        natural = self.drive.natural_period if self.drive and self.drive.has_spring else 0.0
        duration = LAST_CYCLES * (self.measures.period or natural)
        return self.history.end(min(duration, span) or 0.05 * span)
