"""Measures from samples: stamps become time and losses, samples become knots, knots cycles."""

from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.physics.knots import BoolArray, FloatArray, Knots, knots_from_samples
from stickslip_ros.physics.measures import UNBOUNDED_BELT_SPEEDS, Cycle, CycleMeter, Measures

IntArray = npt.NDArray[np.int64]

NANOSECONDS = 1_000_000_000
"""In a second: what stamps count."""

_LONGEST_GAP = 10
"""Periods over which a motion may still be interpolated."""

_FEW_STEPS = 10
"""Steps after which the period is taken as known."""

_RESTING_PART = 10
"""The force at rest is that of the last tenth of the time."""


class _Rows(NamedTuple):
    stamp: IntArray
    position: FloatArray
    velocity: FloatArray
    belt_velocity: FloatArray

    def select(self, rows: slice | BoolArray) -> Self:
        return type(self)(
            self.stamp[rows], self.position[rows], self.velocity[rows], self.belt_velocity[rows]
        )

    def followed_by(self, rows: Self) -> Self:
        return type(self)(
            np.concatenate([self.stamp, rows.stamp]),
            np.concatenate([self.position, rows.position]),
            np.concatenate([self.velocity, rows.velocity]),
            np.concatenate([self.belt_velocity, rows.belt_velocity]),
        )


class _Grid:
    """The grid of instants that samples are on, found from their stamps, and what it misses.

    Stamps are rounded to the nanosecond. The period is known all the better the more of it were
    seen, so that a long gap of a whole number of periods can be told from one between segments.
    """

    def __init__(self) -> None:
        self._lost_before = 0
        self._begin()

    def _begin(self) -> None:
        self._step = 0
        self._covered = 0
        self._periods = 0
        self._intervals = 0

    @property
    def lost(self) -> int:
        """How many instants of the grid had no sample."""
        return self._lost_before + self._periods - self._intervals

    def breaks(self, stamp: IntArray) -> list[int]:
        """Follow the stamps (ns), the first of them known; return where the motion is cut.

        That is where a new segment begins, which is no loss, and behind a gap that is too long to
        interpolate over.
        """
        breaks: list[int] = []
        start = 0
        while start < len(stamp):
            steps = np.diff(stamp[start:])
            if self._step == 0 and len(steps) > 0:
                self._step = int(steps[0])
            odd = self._odd(steps)
            end = int(np.argmax(odd)) if odd.any() else len(steps)
            self._follow(steps[:end])
            if end < len(steps) and self._reconsider(int(steps[end])):
                start += end
                continue
            start += end + 1
            if end < len(steps):
                breaks.append(start)
                self._jump(int(steps[end]))
        return breaks

    def _odd(self, steps: IntArray) -> BoolArray:
        """Return which steps are not a few whole periods."""
        if self._step <= 0:
            return np.ones(len(steps), dtype=bool)
        periods = np.rint(steps / self._step)
        off_grid = np.abs(steps - periods * self._step) > periods + 1.0
        return off_grid | (periods < 1.0) | (periods > _LONGEST_GAP)

    def _follow(self, steps: IntArray) -> None:
        if len(steps) > 0:
            self._covered += int(steps.sum())
            self._periods += int(np.rint(steps / self._step).sum())
            self._intervals += len(steps)

    def _reconsider(self, step: int) -> bool:
        """Take the first few steps for several periods each if a shorter one fits into them."""
        times = round(self._step / step) if step > 0 else 0
        fits = times > 1 and abs(self._step - times * step) <= times + 1
        if not fits or self._intervals > _FEW_STEPS:
            return False
        self._periods *= times
        self._step = step
        return True

    def _jump(self, gap: int) -> None:
        """Count a long gap as loss if it is on the grid, otherwise begin a new one."""
        if gap > 0 and self._periods > 0:
            period = self._covered / self._periods
            periods = round(gap / period)
            if abs(gap - periods * period) <= 1.0 + periods / self._periods:
                self._covered += gap
                self._periods += periods
                self._intervals += 1
                return
        self._lost_before = self.lost
        self._begin()


class SampleMeter:
    """Measures a motion from its samples, fed in blocks of columns of any length.

    A gap of a whole number of sample periods is loss; any other, and a stamp that goes back, is
    the start of a new segment and not lost.
    """

    def __init__(self, window: int) -> None:
        """Average over the last `window` cycles at most."""
        self.samples = 0
        """Samples seen."""
        self._grid = _Grid()
        self._meter = CycleMeter(window)
        self._last: _Rows | None = None
        self._elapsed = 0

    def feed(
        self,
        stamp: IntArray,
        position: FloatArray,
        velocity: FloatArray,
        belt_velocity: FloatArray,
    ) -> list[Cycle]:
        """Take the samples that follow: stamps in ns, slide and belt in SI units, equal lengths.

        Rows that are not finite count as lost. Return the cycles completed by them.
        """
        finite = np.isfinite(position) & np.isfinite(velocity) & np.isfinite(belt_velocity)
        rows = _Rows(stamp, position, velocity, belt_velocity).select(finite)
        self.samples += len(rows.stamp)
        if self._last is not None:
            rows = self._last.followed_by(rows)
        if len(rows.stamp) == 0:
            return []
        cycles: list[Cycle] = []
        starts = self._grid.breaks(rows.stamp)
        for start, end in zip([0, *starts], [*starts, len(rows.stamp)], strict=True):
            if start > 0:
                self._meter.interrupt()
                self._last = None
            cycles += self._feed_segment(rows.select(slice(start, end)))
        self._last = rows.select(slice(-1, None))
        return cycles

    @property
    def lost_samples(self) -> int:
        """Samples that the stamps say are missing."""
        return self._grid.lost

    @property
    def duration(self) -> float:
        """Simulated time covered, s."""
        return self._elapsed * 1e-9

    def measures(self) -> Measures:
        """Return the means over the last whole cycles."""
        return self._meter.measures()

    def _feed_segment(self, rows: _Rows) -> list[Cycle]:
        stamp, position, velocity, belt_velocity = rows
        time = (self._elapsed + stamp - stamp[0]) * 1e-9
        self._elapsed += int(stamp[-1] - stamp[0])
        knots: Knots = knots_from_samples(time, position, velocity, belt_velocity)
        if self._last is not None:
            knots = knots[1:]  # the sample carried over was fed with its own block
        if np.any(np.abs(velocity) > UNBOUNDED_BELT_SPEEDS * np.abs(belt_velocity)) and np.all(
            belt_velocity != 0.0
        ):
            self._meter.report_run_away()
        return self._meter.feed(knots, float(belt_velocity[-1]))


class ForceMeter:
    """Measures the control force, fed in blocks of columns of any length.

    What it says does not depend on how the run is cut into blocks. Of the past it keeps only the
    magnitudes that are larger than all later ones: no other will be the largest up to the end.
    """

    def __init__(self) -> None:
        self._peak = 0.0
        self._first: int | None = None
        self._stamp = np.empty(0, dtype=np.int64)
        self._magnitude = np.empty(0)

    def feed(self, stamp: IntArray, force: FloatArray) -> None:
        """Take the forces that follow: stamps in ns, forces in N, equal lengths.

        What is not finite is left out; where time goes back, the time at rest is that from there.
        """
        finite = np.isfinite(force)
        stamp = np.concatenate([self._stamp, stamp[finite]])
        magnitude = np.concatenate([self._magnitude, np.abs(force[finite])])
        if len(stamp) == 0:
            return
        self._peak = max(self._peak, float(magnitude.max()))
        restarts = np.flatnonzero(np.diff(stamp) < 0) + 1
        if len(restarts) > 0:
            stamp, magnitude = stamp[restarts[-1] :], magnitude[restarts[-1] :]
        if self._first is None or len(restarts) > 0:
            self._first = int(stamp[0])
        largest_later = np.maximum.accumulate(magnitude[:0:-1])[::-1]
        kept = np.append(magnitude[:-1] > largest_later, True)
        last = int(stamp[-1])
        kept &= stamp >= last - (last - self._first) // _RESTING_PART
        self._stamp, self._magnitude = stamp[kept], magnitude[kept]

    @property
    def peak_force(self) -> float | None:
        """Largest magnitude of the force, N; None without forces."""
        return None if self._first is None else self._peak

    @property
    def resting_force(self) -> float | None:
        """Largest magnitude over the last tenth of the time, N; None without forces."""
        return None if self._first is None else float(self._magnitude[0])


class RunMeter:
    """Measures a run from what is recorded of it: the samples and the control force."""

    def __init__(self, window: int) -> None:
        """Average over the last `window` cycles at most."""
        self.motion = SampleMeter(window)
        self.force = ForceMeter()

    def report(self) -> dict[str, Any]:
        """Return the measures and counts by name, ready for JSON; SI units."""
        return {
            **self.motion.measures().as_dict(),
            "peak_force": self.force.peak_force,
            "resting_force": self.force.resting_force,
            "samples": self.motion.samples,
            "lost_samples": self.motion.lost_samples,
            "duration": self.motion.duration,
        }
