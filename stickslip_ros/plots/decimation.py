"""Fewer points to draw, with every peak kept."""

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray

LONGEST_GAP = 10.0
"""Usual steps beyond which nothing is known of what was between two samples."""


def peaks(bucket: IntArray, *columns: FloatArray) -> IntArray:
    """Return the rows to draw: of each bucket the first, the last, and each column's extremes.

    `bucket` tells, in ascending order, which one each row belongs to; as long as the buckets are
    the columns of pixels of a picture, it looks the same as one of all rows. Rows ascend. What is
    not a number is no extreme.
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
    """Columns over time that come in blocks, however many, kept in as many rows as can be drawn.

    Of rows that are too many, those of short intervals are thinned to their peaks; the intervals
    are a small part of what a column of pixels will show. The last rows are kept as they are, too.
    """

    _MOST_ROWS = 200_000
    _LEAST_INTERVALS = 10_000
    _LAST_ROWS = 50_000

    def __init__(self, columns: int) -> None:
        """Take blocks of a time and so many columns."""
        self._blocks: list[list[FloatArray]] = [[np.empty(0)] * (1 + columns)]
        self._rows = 0
        self._interval = 0.0
        self._last = self._blocks.copy()
        self._last_rows = 0

    def add(self, time: FloatArray, *columns: FloatArray) -> None:
        """Take the rows that follow, in ascending order of time (s)."""
        block = [time, *columns]
        self._blocks.append(block)
        self._rows += len(time)
        if self._rows > self._MOST_ROWS:
            self._thin()
        self._last.append(block)
        self._last_rows += len(time)
        if self._last_rows > 2 * self._LAST_ROWS:
            self._last = [[column[-self._LAST_ROWS :] for column in _joined(self._last)]]
            self._last_rows = self._LAST_ROWS

    def columns(self) -> list[FloatArray]:
        """Return time and columns of what is left."""
        self._blocks = [_joined(self._blocks)]
        return self._blocks[0]

    def since(self, start: float) -> list[FloatArray]:
        """Return time and columns from `start` (s) on, not thinned; some 50,000 rows at most."""
        self._last = [_joined(self._last)]
        time = self._last[0][0]
        return [column[time >= start] for column in self._last[0]]

    def _thin(self) -> None:
        time, *columns = self.columns()
        interval = self._interval or (time[-1] - time[0]) / self._LEAST_INTERVALS or 1.0
        while self._rows > self._MOST_ROWS // 2:
            # Doubled, an interval holds whole ones of those before, and of their peaks the higher.
            rows = peaks(intervals(time, interval), *columns)
            time, *columns = (column[rows] for column in (time, *columns))
            self._rows, self._interval = len(rows), interval
            interval *= 2.0
        self._blocks = [[time, *columns]]


def _joined(blocks: list[list[FloatArray]]) -> list[FloatArray]:
    if len(blocks) == 1:
        return blocks[0]
    return [np.concatenate(parts) for parts in zip(*blocks, strict=True)]


def intervals(time: FloatArray, length: float) -> IntArray:
    """Return the number of the interval of that length (s) in which each time lies."""
    return np.floor(time / length).astype(np.int64)
