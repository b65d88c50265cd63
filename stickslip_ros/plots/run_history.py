"""A run as it goes by, kept in as little as it takes to draw it."""

from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.physics.measures.observer import MeasuredMotion
from stickslip_ros.physics.measures.sampling_grid import LONGEST_GAP
from stickslip_ros.plots.decimation import Trace
from stickslip_ros.samples import LARGEST

_FIRST_ROWS = 20_000
"""Rows of the beginning that are kept as they are, for a phase portrait."""


class DrawnMotion(NamedTuple):
    """Breakpoints, all or some, as columns; SI units."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt_velocity: FloatArray
    stick_time: FloatArray
    """Time that the slide has stuck to the belt up to then, s."""


class RunHistory:
    """What was seen of a run, as an observer of it: kept in constant memory.

    Times in s, all else in SI units. What is not later than all before is left out.
    """

    def __init__(self) -> None:
        self.left_out = 0
        """Samples whose time was not later than that of one before."""
        self.gap = float("inf")
        """Time, s, beyond which nothing is known of what was between two rows of the motion."""
        self.control_gap = float("inf")
        """The same between two control forces."""
        self.relative_speeds: tuple[float, float] | None = None
        """Least and largest velocity relative to the belt, m/s; None without a motion."""
        self.friction = Trace(1)
        """Friction force on the slide, N."""
        self.control = Trace(1)
        """Force (N) by the time from which on it acts or is asked for."""
        self.dropped = Trace(1)
        """Force (N) that was asked for and did not act, as far as that is known."""
        self._motion, self._cycles = Trace(4), Trace(2)
        self._first: list[DrawnMotion] = []
        self._first_rows = 0
        self._stick_time = 0.0
        self._motion_end = self._cycles_end = -float("inf")
        self._friction_end = self._control_end = -float("inf")

    @property
    def motion(self) -> DrawnMotion:
        """The whole motion, thinned to its peaks where it is long."""
        return DrawnMotion(*self._motion.columns())

    @property
    def beginning(self) -> DrawnMotion:
        """The beginning of the motion, not thinned; some 20,000 rows of it."""
        if not self._first:
            return DrawnMotion(*[np.empty(0)] * 5)
        return DrawnMotion(*map(np.concatenate, zip(*self._first, strict=True)))

    def end(self, duration: float) -> DrawnMotion:
        """Return the last `duration` (s) of the motion, not thinned; some 50,000 rows of it."""
        return DrawnMotion(*self._motion.since(self._motion_end - duration))

    @property
    def cycles(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Time at which each cycle was complete, its amplitude (m) and stick fraction."""
        time, amplitude, stick_fraction = self._cycles.columns()
        return time, amplitude, stick_fraction

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Take the motion that follows."""
        self._take_cycles(motion)
        time = motion.breakpoints.time
        if len(time) == 0:
            return
        if self.gap == float("inf"):
            self.gap = motion.longest_step
        # Breakpoints may be of one instant; what goes back in time goes back by more.
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
        if self._first_rows < _FIRST_ROWS:
            self._first.append(drawn)
            self._first_rows += len(time)
        relative = breakpoints.velocity - belt_velocity
        least, largest = self.relative_speeds or (np.inf, -np.inf)
        low, high = float(relative.min()), float(relative.max())
        self.relative_speeds = min(least, low), max(largest, high)

    def _take_cycles(self, motion: MeasuredMotion) -> None:
        time = np.array(motion.cycle_ends)
        columns = np.array([(c.amplitude, c.stick_fraction) for c in motion.cycles])
        later = _later(time, self._cycles_end)
        self._cycles_end = float(time.max(initial=self._cycles_end))
        self._cycles.add(time[later], *columns.reshape(-1, 2)[later].T)

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        """Take the friction force at the samples that follow; what is not known is left out."""
        later = _later(time, self._friction_end)
        self.left_out += int((~later).sum())
        self._friction_end = float(time.max(initial=self._friction_end))
        rows = later & (np.abs(force) <= LARGEST)
        self.friction.add(time[rows], force[rows])

    def take_control(self, time: FloatArray, force: FloatArray, acted: BoolArray) -> None:
        """Take control forces that follow, by the time from which each acts or is asked for."""
        rows = _later(time, self._control_end) & np.isfinite(force)
        self._control_end = float(time.max(initial=self._control_end))
        if self.control_gap == float("inf") and rows.sum() > 1:
            self.control_gap = LONGEST_GAP * float(np.median(np.diff(time[rows])))
        for trace, drawn in ((self.control, rows & acted), (self.dropped, rows & ~acted)):
            trace.add(time[drawn], force[drawn])


def _later(time: FloatArray, end: float) -> BoolArray:
    """Return which times are later than all before, and than `end`."""
    return time > np.maximum.accumulate(np.append(end, time))[:-1]
