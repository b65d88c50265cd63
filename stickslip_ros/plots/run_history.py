"""A run as it goes by, kept in as little as it takes to draw it."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.physics.measures.breakpoints import Breakpoints, breakpoints_from_samples
from stickslip_ros.physics.measures.cycles import Cycle
from stickslip_ros.plots.decimation import LONGEST_GAP, Trace
from stickslip_ros.samples import LARGEST

_FIRST_ROWS = 20_000
"""Rows of the beginning that are kept as they are, for a phase portrait."""


class Rows(NamedTuple):
    """A motion as columns over time, SI units."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt_velocity: FloatArray
    stick_time: FloatArray
    """Time that the slide has stuck to the belt up to then, s."""

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of all parts, one after the other."""
        if not parts:
            return cls(*[np.empty(0)] * 5)
        return cls(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


class _Samples(NamedTuple):
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt_velocity: FloatArray


class RunHistory:
    """What was seen of a run: taken in blocks of any length, kept in constant memory.

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
        self._first: list[Rows] = []
        self._first_rows = 0
        self._end = 0.0
        self._stick_time = 0.0
        self._before: _Samples | None = None
        self._control_time = -float("inf")

    @property
    def motion(self) -> Rows:
        """The whole motion, thinned to its peaks where it is long."""
        return Rows(*self._motion.columns())

    @property
    def beginning(self) -> Rows:
        """The beginning of the motion, not thinned; some 20,000 rows of it."""
        return Rows.joined(self._first)

    def end(self, duration: float) -> Rows:
        """Return the last `duration` (s) of the motion, not thinned; some 50,000 rows of it."""
        return Rows(*self._motion.since(self._end - duration))

    @property
    def cycles(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Time at which each cycle was complete, its amplitude (m) and stick fraction."""
        time, amplitude, stick_fraction = self._cycles.columns()
        return time, amplitude, stick_fraction

    def take_samples(
        self,
        time: FloatArray,
        position: FloatArray,
        velocity: FloatArray,
        belt_velocity: FloatArray,
        friction: FloatArray,
        cycles: Sequence[Cycle],
    ) -> None:
        """Take the samples that follow, and the cycles completed by them; equal lengths.

        What is not to be believed (see `SampleMeter`) is left out; of friction, what is not known.
        """
        believed = np.ones(len(time), dtype=bool)
        for column in (position, velocity, belt_velocity):
            believed &= np.abs(column) <= LARGEST
        columns = (time, position, velocity, belt_velocity, friction)
        time, position, velocity, belt_velocity, friction = (c[believed] for c in columns)
        if self._before is not None:
            time = np.append(self._before.time, time)
            position = np.append(self._before.position, position)
            velocity = np.append(self._before.velocity, velocity)
            belt_velocity = np.append(self._before.belt_velocity, belt_velocity)
            friction = np.append(np.nan, friction)
        if len(time) == 0:
            return
        follows = np.append(True, time[1:] > np.maximum.accumulate(time)[:-1])
        self.left_out += int((~follows).sum())
        samples = _Samples(
            time[follows], position[follows], velocity[follows], belt_velocity[follows]
        )
        if self.gap == float("inf") and len(samples.time) > 1:
            self.gap = _gap(samples.time)
        self._add_between(samples)
        known = np.isfinite(friction) & follows
        self.friction.add(time[known], friction[known])
        self._take_cycles(float(samples.time[-1]), cycles)
        self._before = _Samples(*(column[-1:] for column in samples))

    def take_breakpoints(
        self, breakpoints: Breakpoints, belt_speed: float, cycles: Sequence[Cycle]
    ) -> None:
        """Take the breakpoints that follow, of a motion known between them, and its cycles."""
        if len(breakpoints) == 0:
            return
        time = breakpoints.time
        steps = np.diff(time, prepend=self._end if self._first else time[0])
        self._add(
            time, breakpoints.position, breakpoints.velocity, np.full(len(time), belt_speed),
            np.where(breakpoints.sticking, steps, 0.0),
        )  # fmt: skip
        self._take_cycles(float(time[-1]), cycles)

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        """Take friction forces on the slide (N) that follow."""
        self.friction.add(time, force)

    def take_control(
        self, time: FloatArray, force: FloatArray, acted: BoolArray | None = None
    ) -> None:
        """Take control forces (N) that follow, by the time from which each acts or is asked for.

        All of them have `acted` unless it is given.
        """
        before = np.maximum.accumulate(np.append(self._control_time, time))[:-1]
        rows = (time > before) & np.isfinite(force)
        if self.control_gap == float("inf") and rows.sum() > 1:
            self.control_gap = _gap(time[rows])
        if acted is not None:
            dropped = rows & ~acted
            self.dropped.add(time[dropped], force[dropped])
            rows &= acted
        self.control.add(time[rows], force[rows])
        self._control_time = float(max(self._control_time, time.max(initial=self._control_time)))

    def _take_cycles(self, time: float, cycles: Sequence[Cycle]) -> None:
        self._cycles.add(
            np.full(len(cycles), time),
            np.array([cycle.amplitude for cycle in cycles]),
            np.array([cycle.stick_fraction for cycle in cycles]),
        )

    def _add_between(self, samples: _Samples) -> None:
        """Add samples, of which the first may have been added before, and what is between them."""
        with np.errstate(over="ignore", invalid="ignore"):
            breakpoints = breakpoints_from_samples(*samples, exact_times=False)
        # Number of the sample that ends the interval in which a breakpoint lies.
        number = np.searchsorted(samples.time, breakpoints.time)
        unknown = np.append(False, np.diff(samples.time) > self.gap)[number]
        kept = ~unknown | (breakpoints.time == samples.time[number])
        steps = np.diff(breakpoints.time, prepend=breakpoints.time[0])
        sticking = np.where(breakpoints.sticking & ~unknown, steps, 0.0)
        kept[0] &= self._before is None
        self._add(
            breakpoints.time[kept], breakpoints.position[kept], breakpoints.velocity[kept],
            samples.belt_velocity[number][kept], sticking[kept],
        )  # fmt: skip

    def _add(
        self,
        time: FloatArray,
        position: FloatArray,
        velocity: FloatArray,
        belt_velocity: FloatArray,
        sticking: FloatArray,
    ) -> None:
        """Add rows to all that is kept; `sticking` is the time stuck since the row before, s."""
        if len(time) == 0:
            return
        stick_time = self._stick_time + np.cumsum(sticking)
        rows = Rows(time, position, velocity, belt_velocity, stick_time)
        self._end, self._stick_time = float(time[-1]), float(stick_time[-1])
        self._motion.add(*rows)
        if self._first_rows < _FIRST_ROWS:
            self._first.append(rows)
            self._first_rows += len(time)
        relative = velocity - belt_velocity
        least, largest = self.relative_speeds or (np.inf, -np.inf)
        self.relative_speeds = (
            min(least, float(relative.min())),
            max(largest, float(relative.max())),
        )


def _gap(time: FloatArray) -> float:
    return LONGEST_GAP * float(np.median(np.diff(time)))
