"""The grid of sampling instants: its period, its gaps and its jitter, from stamps."""

import numpy as np

from stickslip_ros.arrays import BoolArray, IntArray
from stickslip_ros.stamps import NANOSECONDS

LONGEST_GAP = 10
"""Longest gap, in periods, over which a motion may be interpolated."""

_FEW_STEPS = 10
"""Number of steps after which the period counts as known."""

_LOOK_AHEAD = 4096
"""Number of steps that are looked at once: from each cut to the end would take quadratic time."""

_LONGEST_STEP = 86_400 * NANOSECONDS
"""A longer step is neither a period nor a loss: one of the two stamps is not from this run."""

_LONGEST_LOSS = 10**7
"""Longest gap on the grid, in periods, that may be a loss."""


class SamplingGrid:
    """Grid of sampling instants, found from the stamps, and the number of missing samples.

    Stamps are rounded to the nanosecond, or read from a clock: then the steps vary about a period,
    and a late sample and the punctual one after it cancel out. The more periods have been seen, the
    more exactly the period is known, so that a long gap of a whole number of periods can be
    distinguished from one between segments.
    """

    def __init__(self) -> None:
        self.steps_back = 0
        """Number of stamps that are not later than the one before."""
        self.strays = 0
        """Number of those, and of others that are not whole periods after the one before."""
        self._lost_before = 0
        self._begin()

    def _begin(self) -> None:
        self._first: list[int] = []
        self._period = float(_LONGEST_STEP)
        self._count, self._next_estimate = 0, 2 * _FEW_STEPS
        self._covered = self._periods = self._missing = 0

    @property
    def lost(self) -> int:
        """Number of instants of the grid without a sample."""
        return self._lost_before + max(self._missing, 0)

    def cuts(self, stamp: IntArray, period: float | None) -> list[int]:
        """Follow the stamps (ns), the first of which is known; return the rows that start anew.

        The motion is cut where a new segment starts, which is no loss, and after a gap that is too
        long for interpolation. `period` is that of the plant, ns, if it is known.
        """
        steps, rows, done = np.diff(stamp), list[int](), 0
        back = steps <= 0
        self.steps_back += np.count_nonzero(back)
        self.strays += int(np.count_nonzero(back if period is None else ~_whole(steps, period)))
        while done < len(steps):
            # Up to where the period is estimated again: what is found must not depend on blocks.
            known = self._count >= _FEW_STEPS
            most = min(self._next_estimate - self._count, _LOOK_AHEAD) if known else 1
            ahead = steps[done : done + most]
            longest = self._period * (LONGEST_GAP if self._count else 1)
            cut = (ahead <= 0) | (ahead > longest)
            count = int(np.argmax(cut)) if cut.any() else len(ahead)
            done += count
            if count > 0:
                self._follow(ahead[:count])
            else:
                self._jump(int(ahead[0]))
                done += 1
                rows.append(done)
        return rows

    def on_grid(self, steps: IntArray) -> BoolArray:
        """Return which steps (ns) are a whole number of periods, within the rounding of stamps."""
        return _whole(steps, self._period)

    def _follow(self, steps: IntArray) -> None:
        """Count some of the steps up to the next gap."""
        self._count += len(steps)
        if self._count <= _FEW_STEPS:
            self._first += steps.tolist()
            steps, self._period = np.array(self._first), _period_of(np.array(self._first))
            self._covered = self._periods = self._missing = 0
        periods = np.rint(steps / self._period)
        # A gap off the grid tells nothing of the period, a late sample on no grid does.
        used = self.on_grid(steps) | (periods == 1.0)
        # A long one among the first steps, off the grid, is before a segment, and no loss.
        self._missing += int((periods - 1.0)[used | (periods <= LONGEST_GAP)].sum())
        self._covered += int(steps[used].sum())
        self._periods += int(periods[used].sum())
        if self._count == self._next_estimate:
            self._next_estimate *= 2
            self._period = self._covered / self._periods
            if self._missing < -self._count / 2:  # the rate is a higher one by now
                self._begin()

    def _jump(self, gap: int) -> None:
        """Count a long gap as a loss if it is on the grid, otherwise start a new grid."""
        if 0 < gap <= _LONGEST_STEP and self._periods > 0:
            period = self._covered / self._periods
            periods = round(gap / period)
            on_grid = abs(gap - periods * period) <= 1.0 + periods / self._periods
            if on_grid and periods <= _LONGEST_LOSS:
                self._period = period
                self._follow(np.array([gap]))
                return
        self._lost_before = self.lost
        self._begin()


def _period_of(steps: IntArray) -> float:
    """Return the period of a few steps (ns): the shortest one if it divides all others."""
    shortest = float(steps.min())
    if steps.max() <= _LONGEST_LOSS * shortest and _whole(steps, shortest).all():
        return float(steps.sum() / np.rint(steps / shortest).sum())
    middle = np.sort(steps)[(len(steps) - 1) // 2]
    return float(np.mean(steps[np.rint(steps / middle) == 1.0]))


def _whole(steps: IntArray, period: float) -> BoolArray:
    """Return which steps are one or more whole periods, ns, within the rounding of stamps."""
    periods = np.rint(steps / period)
    return (periods >= 1.0) & (np.abs(steps - periods * period) <= periods + 1.0)
