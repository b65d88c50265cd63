"""The last of a motion that is still going on, as few points as a picture of it needs."""

from collections.abc import Sequence
from dataclasses import fields
from threading import Lock
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.physics.measures.control_forces import HELD_FORCES, DroppedForces
from stickslip_ros.plots.decimation import LONGEST_GAP, peaks
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS

_NONE = ForceColumns(np.empty(0, np.int64), np.empty(0))
_MOST_ROWS = 200_000
_ORBIT_BUCKETS = 1_000
_FINE_BUCKETS = 10_000
"""Of what is kept, once there are too many rows: many more than a picture has pixels."""


class Line(NamedTuple):
    """Points to connect; SI units."""

    x: FloatArray
    y: FloatArray


class Frame(NamedTuple):
    """What a picture shows; times in s before the newest sample, so none is positive; SI units."""

    end: float
    """Stamp of the newest sample, s from the first of all."""
    position: Line
    """Over time, as the next three."""
    velocity: Line
    belt_velocity: Line
    force: Line
    dropped: Line
    """Forces that were sent and did not act, over time."""
    orbit: Line
    """Velocity over displacement."""


class LiveTrace:
    """Takes in blocks of samples and forces as they come, and gives frames; from any threads.

    However long it is fed, its memory is bounded: what becomes too much is thinned out, all peaks
    kept. Stamps that do not go on, as those of a plant that was started again, begin it anew.
    """

    def __init__(self, longest: float) -> None:
        """Keep the last `longest` seconds of simulated time."""
        self._lock = Lock()
        self.longest = longest
        """How much is kept, s; a frame shows no more."""
        self._begin()

    def feed(
        self, states: SampleColumns, forces: ForceColumns, dropped: ForceColumns = _NONE
    ) -> None:
        """Take in what has come, `dropped` forces in any order; empty blocks are welcome."""
        longest = round(self.longest * NANOSECONDS)
        with self._lock:
            descents = np.flatnonzero(np.diff(states.stamp) <= 0)
            if len(descents):
                self._begin()
                states = _rows(states, slice(int(descents[-1]) + 1, None))
            if len(states.stamp):
                if states.stamp[0] <= self._states.newest:
                    self._begin()
                if self._first is None:
                    self._first = int(states.stamp[0])
                columns = states.position, states.velocity, states.belt_velocity
                self._states.add(states.stamp, columns, longest)
            if len(forces.stamp):
                # A controller started again may answer for the past: the picture goes by stamps.
                later = forces.stamp > self._forces.newest
                # One for the far future would hide all others.
                later &= forces.stamp < max(self._states.newest, 0) + NANOSECONDS
                sent = forces.force[later]
                columns = sent, np.full(len(sent), np.nan)
                self._forces.add(forces.stamp[later], columns, longest)
            self._dropped.add(dropped)
            stamp, (acted, lost) = self._forces.last(HELD_FORCES)
            rows = self._dropped.among(ForceColumns(stamp, acted))
            acted[rows], lost[rows] = np.nan, acted[rows]

    def frame(self, window: float, orbit: float, buckets: int) -> Frame | None:
        """Return the last `window` s for `buckets` columns of pixels, and the last `orbit` s.

        None before the first sample.
        """
        with self._lock:
            if self._first is None:
                return None
            end = self._states.newest
            begin = end - round(window * NANOSECONDS)
            # On a fixed grid of times the points of a moving picture keep their places.
            width = max((end - begin) // buckets, 1)
            stamp, columns = self._states.since(begin)
            force_stamp, (force, lost) = self._forces.since(begin)
            acted = ~np.isnan(force)
            lost_stamp = force_stamp[~np.isnan(lost)]
            turning = round(orbit * NANOSECONDS)
            orbit_stamp, (x, v, _) = self._states.since(end - turning)
            rows = peaks(orbit_stamp // max(turning // _ORBIT_BUCKETS, 1), x, v)
            position, velocity, belt = (
                _line(stamp, column, end, width, self._states.step) for column in columns
            )
            return Frame(
                (end - self._first) / NANOSECONDS,
                position,
                velocity,
                belt,
                _line(force_stamp[acted], force[acted], end, width, self._forces.step, lost_stamp),
                _line(lost_stamp, lost[~np.isnan(lost)], end, width, self._forces.step),
                Line(x[rows], v[rows]),
            )

    def _begin(self) -> None:
        self._first: int | None = None
        self._states = _Rolling(3)
        self._forces = _Rolling(2)
        """Those that acted, those that did not; one of them is NaN."""
        self._dropped = DroppedForces()


class _Rolling:
    """Columns by ascending stamp, of which the oldest are let go."""

    def __init__(self, columns: int) -> None:
        self._size = 0
        self.step = 0
        """Longest step, ns, from row to row that is due to rows having been thinned out."""
        self._stamp: IntArray = np.empty(0, dtype=np.int64)
        self._columns = [np.empty(0) for _ in range(columns)]
        self.newest = -1

    def add(self, stamp: IntArray, columns: Sequence[FloatArray], longest: int) -> None:
        """Append rows; let go what is older than the newest by more than `longest`, ns."""
        if not len(stamp):
            return
        if self._size + len(stamp) > len(self._stamp):
            self._make_room(len(stamp), longest)
        rows = slice(self._size, self._size + len(stamp))
        self._stamp[rows] = stamp
        for kept, column in zip(self._columns, columns, strict=True):
            kept[rows] = column
        self._size = rows.stop
        self.newest = int(stamp[-1])

    def since(self, begin: int) -> tuple[IntArray, list[FloatArray]]:
        """Return the rows from a stamp on, as long as nothing is added."""
        rows = slice(int(np.searchsorted(self._stamp[: self._size], begin)), self._size)
        return self._stamp[rows], [column[rows] for column in self._columns]

    def last(self, number: int) -> tuple[IntArray, list[FloatArray]]:
        """Return so many of the last rows, to be changed as long as nothing is added."""
        rows = slice(max(0, self._size - number), self._size)
        return self._stamp[rows], [column[rows] for column in self._columns]

    def _make_room(self, number: int, longest: int) -> None:
        stamp, columns = self.since(self.newest - longest)
        if len(stamp) + number > _MOST_ROWS:
            self.step = max(longest // _FINE_BUCKETS, self.step, 1)
            rows = peaks(stamp // self.step, *columns)
            stamp, columns = stamp[rows], [column[rows] for column in columns]
        self._size = len(stamp)
        room = self._size + 2 * number + 1024
        self._stamp = np.concatenate([stamp, np.empty(room, dtype=np.int64)])
        self._columns = [np.concatenate([column, np.empty(room)]) for column in columns]


def _line(
    stamp: IntArray,
    column: FloatArray,
    end: int,
    width: int,
    step: int,
    others: IntArray = _NONE.stamp,
) -> Line:
    """Return the points of a line that is broken, by NaN, where samples are missing.

    Steps of up to `step` (ns) are not for that reason. Where there were `others` (ns) instead, it
    is two NaN.
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


def _rows(states: SampleColumns, rows: slice) -> SampleColumns:
    return SampleColumns(*(getattr(states, field.name)[rows] for field in fields(states)))
