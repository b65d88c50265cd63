"""Samples with noise as columns, and the last cycles among them."""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray, Table
from stickslip_ros.measures.cycle_measures import STALE_PERIODS, Cycle
from stickslip_ros.measures.noise import impulses

_UNKNOWN = 2
"""Number of the last samples that may still be impulses."""


@dataclass
class NoisySamples(Table):
    """Columns of samples without impulses; SI units."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt: FloatArray

    def row(self, time: float) -> int:
        """Return the first row that is not earlier than a time, s."""
        return int(np.searchsorted(self.time, time))


class Point(NamedTuple):
    """A position at an instant."""

    time: float
    position: float


class LastCycles:
    """The last cycles of a part of a run without a gap, with their samples; SI units."""

    def __init__(self, most_cycles: int) -> None:
        self.cycles: deque[Cycle] = deque(maxlen=most_cycles)
        self.lows: deque[Point] = deque(maxlen=most_cycles + 1)
        """Lowest points: the start of each cycle, and the end of the last."""
        self._table, self._rows = np.empty((4, 0)), slice(0, 0)
        """Columns with room to grow, and the rows of them that are held."""

    @property
    def held(self) -> NoisySamples:
        """Samples so far; the last two may still be impulses."""
        return NoisySamples(*self._table[:, self._rows])

    @property
    def samples(self) -> NoisySamples:
        """Samples that are no impulses."""
        return self.held[:-_UNKNOWN]

    def add(self, part: NoisySamples, noise: float) -> None:
        """Add samples, and drop impulses beyond this noise, which the samples beside them tell."""
        self._replace_last(0, part)
        if noise > 0.0:
            last = self.held[-len(part) - 2 * _UNKNOWN :]
            found = impulses(last.position, noise)
            if found.any():
                self._replace_last(len(last), last[~found])

    def _replace_last(self, rows: int, samples: NoisySamples) -> None:
        start, stop = self._rows.start, max(self._rows.stop - rows, self._rows.start)
        end = stop + len(samples)
        if end > self._table.shape[1]:
            table = np.empty((4, 2 * (end - start) + 1024))
            table[:, : stop - start] = self._table[:, start:stop]
            self._table, start, stop, end = table, 0, stop - start, end - start
        self._table[:, stop:end] = list(vars(samples).values())
        self._rows = slice(start, end)

    def drop_first(self, rows: int) -> None:
        """Drop samples, and the cycles that began with them."""
        self._rows = slice(self._rows.start + rows, self._rows.stop)
        while len(self.lows) > 1 and self.lows[0].time < self._table[0, self._rows.start]:
            self.lows.popleft()
            self.cycles.popleft()

    @property
    def resting(self) -> bool:
        """Whether no reversal has come for several periods."""
        if not self.cycles:
            return False
        since = float(self.samples.time[-1]) - self.lows[-1].time
        return since > STALE_PERIODS * self.cycles[-1].period
