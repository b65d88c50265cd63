"""History of a run, reduced to the data that its figure needs."""

from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.physics.measures.run_meter import RunAnalysis
from stickslip_ros.physics.measures.sample_meter import MeasuredMotion
from stickslip_ros.physics.measures.sampling_grid import LONGEST_GAP
from stickslip_ros.plots.decimation import Trace
from stickslip_ros.samples import LARGEST

_FIRST_ROWS = 20_000
"""Rows of the start that are kept unchanged, for a phase portrait."""

_SWITCHED_ROWS = 20_000
"""Rows from the first force on that are kept unchanged, and as much time before."""


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
        self.switched_on: float | None = None
        """Time of the first force that is not zero, s; None as long as there is none."""
        self.conclusions = RunAnalysis(None, None)
        """What was concluded from a record."""
        self._motion, self._cycles = Trace(4), Trace(2)
        self._first: list[DrawnMotion] = []
        self._switched: DrawnMotion | None = None
        self._first_rows = 0
        self._stick_time = 0.0
        self._motion_end = self._cycles_end = -float("inf")
        self._friction_end = self._control_end = -float("inf")

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
        return DrawnMotion(*self._motion.since(self._motion_end - duration))

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

    def take_conclusions(self, conclusions: RunAnalysis) -> None:
        """Keep what was concluded."""
        self.conclusions = conclusions

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Add the next part of the motion."""
        self._take_cycles(motion)
        time = motion.breakpoints.time
        if len(time) == 0:
            return
        if self.gap == float("inf"):
            self.gap = motion.longest_step
        # Breakpoints may share an instant; a step back in time is larger.
        rows = (time > self._motion_end) | (time[0] >= self._motion_end)
        breakpoints, belt_velocity = motion.breakpoints[rows], motion.belt_velocity[rows]
        if len(breakpoints) == 0:
            return
        time = breakpoints.time
        steps = np.diff(time, prepend=self._motion_end if self._first else time[0])
        stick_time = self._stick_time + np.cumsum(np.where(breakpoints.sticking, steps, 0.0))
        self._motion_end, self._stick_time = float(time[-1]), float(stick_time[-1])
        drawn = DrawnMotion(
            time, breakpoints.position, breakpoints.velocity, belt_velocity, stick_time
        )
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
            kept = self._motion.since(2.0 * self.switched_on - self._motion_end)
            self._switched = DrawnMotion(*(column.copy() for column in kept))

    def _take_cycles(self, motion: MeasuredMotion) -> None:
        time = np.array(motion.cycle_ends)
        columns = np.array([(c.amplitude, c.stick_fraction) for c in motion.cycles])
        later = _later(time, self._cycles_end)
        self._cycles_end = float(time.max(initial=self._cycles_end))
        self._cycles.add(time[later], *columns.reshape(-1, 2)[later].T)

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        """Add the friction force at the next samples; unknown values are omitted."""
        later = _later(time, self._friction_end)
        self.left_out += int((~later).sum())
        self._friction_end = float(time.max(initial=self._friction_end))
        rows = later & (np.abs(force) <= LARGEST)
        self.friction.add(time[rows], force[rows])

    def take_control(self, time: FloatArray, force: FloatArray, acted: BoolArray) -> None:
        """Add the next control forces, with the time from which each acts or is requested."""
        rows = _later(time, self._control_end) & np.isfinite(force)
        self._control_end = float(time.max(initial=self._control_end))
        if self.control_gap == float("inf") and rows.sum() > 1:
            self.control_gap = LONGEST_GAP * float(np.median(np.diff(time[rows])))
        acting = np.flatnonzero(rows & acted & (force != 0.0))
        if self.switched_on is None and len(acting):
            self.switched_on = float(time[acting[0]])
        for trace, drawn in ((self.control, rows & acted), (self.dropped, rows & ~acted)):
            trace.add(time[drawn], force[drawn])


def _later(time: FloatArray, end: float) -> BoolArray:
    """Return which times are later than all earlier ones and than `end`."""
    return time > np.maximum.accumulate(np.append(end, time))[:-1]
