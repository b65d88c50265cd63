"""The most recent part of a running motion, in as few points as a figure needs."""

from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.measures.control_forces import HELD_FORCES, DroppedForces
from stickslip_ros.measures.sampling_grid import LONGEST_GAP
from stickslip_ros.samples import NO_FORCES, ForceColumns, SampleColumns
from stickslip_ros.show.run_history import Trace, peaks
from stickslip_ros.stamps import NANOSECONDS


class Line(NamedTuple):
    """Points to connect; SI units."""

    x: FloatArray
    y: FloatArray


class Frame(NamedTuple):
    """The contents of a figure; SI units, times (0 or below) from the newest sample."""

    end: float
    """Stamp of the newest sample, s from the first of all."""
    position: Line
    """Over time, like the next three."""
    velocity: Line
    belt_velocity: Line
    force: Line
    dropped: Line
    """Forces that were sent and did not act, over time."""
    orbit: Line
    """Velocity over displacement."""
    loop: Line
    """Friction force over the velocity relative to the belt."""


class LiveTrace:
    """Collects blocks of samples and forces as they arrive, and returns frames; thread-safe.

    Its memory is bounded: excess rows are thinned, with all peaks kept. Stamps that do not
    increase, as after a restart of the plant, restart it too.
    """

    def __init__(self, longest: float) -> None:
        """Keep the last `longest` seconds of simulated time."""
        self._lock = Lock()
        self.longest = longest
        """Duration that is kept, s; a frame shows no more."""
        self._begin()

    def feed(
        self, states: SampleColumns, forces: ForceColumns, dropped: ForceColumns = NO_FORCES
    ) -> None:
        """Add new samples and forces, `dropped` forces in any order; blocks may be empty."""
        with self._lock:
            descents = np.flatnonzero(np.diff(states.stamp) <= 0)
            if len(descents):
                self._begin()
                states = states[int(descents[-1]) + 1 :]
            if len(states):
                if states.stamp[0] <= self.newest:
                    self._begin()
                if self._first is None:
                    self._first = int(states.stamp[0])
                self.newest = int(states.stamp[-1])
                self._states.add(
                    states.stamp,
                    states.position,
                    states.velocity,
                    states.belt_velocity,
                    states.friction_force,
                )
            # A restarted controller may answer old samples: the figure follows the stamps.
            later = forces.stamp > self._newest_force
            # A force stamped far in the future would hide all others.
            later &= forces.stamp < max(self.newest, 0) + NANOSECONDS
            sent = forces[later]
            self._forces.add(sent.stamp, sent.force, np.full(len(sent), np.nan))
            self._newest_force = int(sent.stamp.max(initial=self._newest_force))
            self._dropped.add(dropped)
            stamp, acted, lost = (column[-HELD_FORCES:] for column in self._forces.columns())
            rows = self._dropped.among(ForceColumns(stamp, acted))
            acted[rows], lost[rows] = np.nan, acted[rows]
            longest = round(self.longest * NANOSECONDS)
            self._states.forget(self.newest - longest)
            self._forces.forget(self._newest_force - longest)

    def frame(self, window: float, orbit: float, buckets: int) -> Frame | None:
        """Return the last `window` s for `buckets` pixel columns, and an orbit of `orbit` s.

        Return None before the first sample.
        """
        with self._lock:
            if self._first is None:
                return None
            end = self.newest
            begin = end - round(min(window, self.longest) * NANOSECONDS)
            # With a fixed grid of times the points of a moving figure keep their places.
            width = max((end - begin) // buckets, 1)
            stamp, *columns, _ = _since(self._states, begin)
            force_stamp, force, lost = _since(self._forces, begin)
            acted = ~np.isnan(force)
            lost_stamp = force_stamp[~np.isnan(lost)]
            turning = round(orbit * NANOSECONDS)
            orbit_stamp, x, v, moving, friction = _since(self._states, end - turning)
            rows = peaks(orbit_stamp // max(turning // 1_000, 1), x, v)
            position, velocity, belt = (
                _line(stamp, column, end, width, self._states.interval) for column in columns
            )
            return Frame(
                (end - self._first) / NANOSECONDS,
                position,
                velocity,
                belt,
                _line(
                    force_stamp[acted], force[acted], end, width, self._forces.interval, lost_stamp
                ),
                _line(lost_stamp, lost[~np.isnan(lost)], end, width, self._forces.interval),
                Line(x[rows], v[rows]),
                Line((v - moving)[rows], friction[rows]),
            )

    def samples(self, window: float, end: float) -> list[FloatArray]:
        """Return what is kept of the `window` s up to `end`, sample by sample.

        Times are s from the first sample of all. The columns are time, position, velocity, belt
        velocity, friction force and the control force that was sent for the sample; NaN: none.
        """
        with self._lock:
            if self._first is None:
                return [np.empty(0)] * 6
            last = self._first + round(end * NANOSECONDS)
            begin = last - round(min(window, self.longest) * NANOSECONDS)
            stamp, *columns = _since(self._states, begin)
            shown = stamp <= last
            stamp = stamp[shown]
            sent_stamp, acted, lost = self._forces.columns()
            force = np.full(len(stamp), np.nan)
            if len(sent_stamp):
                rows = np.clip(np.searchsorted(sent_stamp, stamp), 0, len(sent_stamp) - 1)
                same = sent_stamp[rows] == stamp
                force[same] = np.where(np.isnan(acted), lost, acted)[rows][same]
            time = (stamp - self._first) / NANOSECONDS
            return [time, *(column[shown] for column in columns), force]

    def _begin(self) -> None:
        self._first: int | None = None
        self._newest_force = self.newest = -1
        """Stamp of the newest sample, ns; -1 before the first."""
        self._states = Trace(4, np.int64)
        self._forces = Trace(2, np.int64)
        """Columns of forces that acted and that did not; one of the two is NaN in each row."""
        self._dropped = DroppedForces()


def _since(trace: Trace, begin: int) -> list[NDArray[Any]]:
    """Return the stamps from `begin` on, and the columns."""
    stamp, *columns = trace.columns()
    first = int(np.searchsorted(stamp, begin))
    return [stamp[first:], *(column[first:] for column in columns)]


def _line(
    stamp: IntArray,
    column: FloatArray,
    end: int,
    width: int,
    step: float,
    others: IntArray = NO_FORCES.stamp,
) -> Line:
    """Return the points of a line, with NaN where samples are missing.

    A step of up to `step` (ns) does not count as missing. Two NaN mark a gap that contains `others`
    (ns).
    """
    rows = peaks(stamp // width, column)
    x, y = (stamp[rows] - end) / NANOSECONDS, column[rows]
    if len(stamp) > 1:
        steps = np.diff(stamp)
        behind = np.flatnonzero(steps > LONGEST_GAP * max(float(np.median(steps)), step)) + 1
        instead = np.diff(np.searchsorted(others, stamp))[behind - 1] > 0
        behind = np.repeat(behind, 1 + instead)
        gaps = np.searchsorted(rows, behind)
        x = np.insert(x, gaps, (stamp[behind] - end) / NANOSECONDS)
        y = np.insert(y, gaps, np.nan)
    return Line(x, y)
