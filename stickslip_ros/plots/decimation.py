"""Decimation of points to draw that keeps every peak."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip_ros.arrays import FloatArray, IntArray


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
        self.interval = 0.0
        """Longest time between rows that results from thinning."""

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
        """Remove the rows before a time once they are half of all rows."""
        first = int(np.searchsorted(self._kept[0][: self._size], end))
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
