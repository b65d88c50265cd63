"""The grid of sampling instants: its period, its gaps and its jitter, from stamps."""

from statistics import median
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, IntArray
from stickslip_ros.stamps import NANOSECONDS

LONGEST_GAP = 10
"""Longest gap, in periods, over which a motion may be interpolated."""

_FEW_STEPS = 10
"""Number of steps after which the period counts as known."""

_LONGEST_STEP = 86_400 * NANOSECONDS
"""A longer step is neither a period nor a loss: one of the two stamps is not from this run."""

_LONGEST_LOSS = 10**7
"""Longest gap on the grid, in periods, that may be a loss."""


class Segment(NamedTuple):
    """Part of a block without a cut: from row `start` to the start of the next segment."""

    start: int
    jittered: bool


class _JitteredSteps:
    """Steps that vary about a period, for example between readings of a clock."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._count = 0
        self._missing = 0
        self._single_count = 0
        self._single_time = 0
        self._next_estimate = _FEW_STEPS

    @property
    def lost(self) -> int:
        """Number of missing samples; a late sample and the punctual one after it cancel out."""
        return max(self._missing, 0)

    def follow(self, steps: IntArray) -> int:
        """Follow some of the steps (ns) up to the next gap; return how many, 0 at a gap."""
        steps = steps[: self._next_estimate - self._count]
        steps = steps[: _first((steps <= 0) | (steps > LONGEST_GAP * self._period))]
        periods = np.rint(steps / self._period)
        single = steps[periods == 1.0]
        self._count += len(steps)
        self._missing += int(periods.sum()) - len(steps)
        self._single_count += len(single)
        self._single_time += int(single.sum())
        if self._count == self._next_estimate:
            self._next_estimate *= 2
            if self._single_count > 0:
                self._period = self._single_time / self._single_count
        return len(steps)


class SamplingGrid:
    """Grid of sampling instants, found from the stamps, and the number of missing samples.

    Stamps are rounded to the nanosecond. The more periods have been seen, the more exactly the
    period is known, so that a long gap of a whole number of periods can be distinguished from one
    between segments. Stamps that leave the grid soon and repeatedly are on no grid: their steps are
    jittered.
    """

    def __init__(self) -> None:
        self._lost_before = 0
        self._jittered: _JitteredSteps | None = None
        self._off_grid: list[float] = []
        self._begin()

    def _begin(self) -> None:
        self._step = 0
        self._covered = 0
        self._periods = 0
        self._intervals = 0
        self._since_gap = 0

    @property
    def lost(self) -> int:
        """Number of instants of the grid without a sample."""
        lost = self._lost_before + self._periods - self._intervals
        return lost if self._jittered is None else lost + self._jittered.lost

    def segments(self, stamp: IntArray) -> list[Segment]:
        """Follow the stamps (ns), the first of which is known; return the segments of the motion.

        The motion is cut where a new segment starts, which is no loss, and after a gap that is too
        long for interpolation. The first segment continues the motion so far.
        """
        steps = np.diff(stamp)
        segments = [Segment(0, self._jittered is not None)]
        done = 0
        while done < len(steps):
            followed = self._follow(steps[done:])
            done += followed
            if followed > 0 or self._reconsider(int(steps[done])):
                continue
            self._jump(int(steps[done]))
            done += 1
            segments.append(Segment(done, self._jittered is not None))
        return segments

    def _follow(self, steps: IntArray) -> int:
        """Follow some of the steps up to the next irregular one; return how many."""
        if self._jittered is not None:
            return self._jittered.follow(steps)
        if self._step == 0:
            self._step = int(steps[0])
        # A longer look ahead than the stretch since the last gap could take quadratic time.
        steps = steps[: max(64, self._since_gap)]
        steps = steps[: _first(self._odd(steps))]
        if len(steps) > 0:
            self._covered += int(steps.sum())
            self._periods += int(np.rint(steps / self._step).sum())
            self._intervals += len(steps)
            self._since_gap += len(steps)
        return len(steps)

    def _odd(self, steps: IntArray) -> BoolArray:
        """Return which steps are not a few whole periods."""
        if not 0 < self._step <= _LONGEST_STEP:
            return np.ones(len(steps), dtype=bool)
        periods = np.rint(steps / self._step)
        off_grid = np.abs(steps - periods * self._step) > periods + 1.0
        return off_grid | (periods < 1.0) | (periods > LONGEST_GAP)

    def _reconsider(self, step: int) -> bool:
        """Count the first few steps as several periods each if a shorter step divides them."""
        times = round(self._step / step) if step > 0 else 0
        fits = 1 < times <= _LONGEST_LOSS and abs(self._step - times * step) <= times + 1
        if not fits or self._intervals > _FEW_STEPS:
            return False
        self._periods *= times
        self._step = step
        return True

    def _jump(self, gap: int) -> None:
        """Count a long gap as a loss if it is on the grid, otherwise start a new grid."""
        self._since_gap = 0
        if 0 < gap <= _LONGEST_STEP and self._periods > 0:
            period = self._covered / self._periods
            periods = round(gap / period)
            on_grid = abs(gap - periods * period) <= 1.0 + periods / self._periods
            if on_grid and periods <= _LONGEST_LOSS:
                self._covered += gap
                self._periods += periods
                self._intervals += 1
                return
        self._lost_before = self.lost
        self._jittered = self._jitter(gap)
        self._begin()

    def _jitter(self, gap: int) -> _JitteredSteps | None:
        """Return jittered steps for a gap off the grid if the grid was left too often."""
        if self._intervals > 1000:  # a steady grid: leaving it once is no sign of jitter
            self._off_grid.clear()
        period = self._covered / self._periods if self._periods > 0 else 0.0
        if not 0.0 < period / 5 <= gap <= 5 * period:
            self._off_grid.clear()
            return None
        self._off_grid += [period, gap]
        if len(self._off_grid) < 6:  # two for each gap: one or two gaps are not enough
            return None
        steps = _JitteredSteps(median(self._off_grid))
        self._off_grid.clear()
        return steps


def _first(found: BoolArray) -> int:
    """Return the index of the first row that is true, or the number of rows if there is none."""
    return int(np.argmax(found)) if found.any() else len(found)
