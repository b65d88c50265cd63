"""Measures from samples: stamps become time and losses, samples become knots, knots cycles."""

from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.physics.knots import BoolArray, FloatArray, Knots, knots_from_samples
from stickslip_ros.physics.measures import UNBOUNDED_BELT_SPEEDS, Cycle, CycleMeter, Measures

IntArray = npt.NDArray[np.int64]

_LONGEST_GAP = 10
"""Periods over which a motion may still be interpolated."""

_RESTING_SHARE = 0.1
_FORCE_BLOCK = 256


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


class SampleMeter:
    """Measures a motion from its samples, fed in blocks of columns of any length.

    A gap of a whole number of sample periods is loss; any other, and a stamp that goes back, is
    the start of a new segment and not lost.
    """

    def __init__(self, window: int) -> None:
        """Average over the last `window` cycles at most."""
        self.samples = 0
        """Samples seen."""
        self.lost_samples = 0
        """Samples that the stamps say are missing."""
        self._meter = CycleMeter(window)
        self._last: _Rows | None = None
        self._step = 0
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
        starts = self._segment_starts(rows.stamp)
        for start, end in zip([0, *starts], [*starts, len(rows.stamp)], strict=True):
            if start > 0:
                self._begin_segment()
            cycles += self._feed_segment(rows.select(slice(start, end)))
        self._last = rows.select(slice(-1, None))
        return cycles

    @property
    def duration(self) -> float:
        """Simulated time covered, s."""
        return self._elapsed * 1e-9

    def measures(self) -> Measures:
        """Return the means over the last whole cycles."""
        return self._meter.measures()

    def _begin_segment(self) -> None:
        self._meter.interrupt()
        self._last = None
        self._step = 0

    def _segment_starts(self, stamp: IntArray) -> list[int]:
        """Count what was lost; return the rows that do not continue the row before."""
        steps = np.diff(stamp)
        forward = steps[steps > 0]
        if len(forward) == 0:
            return (np.flatnonzero(steps <= 0) + 1).tolist()
        shortest = int(forward.min())
        self._step = min(self._step, shortest) if self._step else shortest
        periods = np.rint(steps / self._step)
        # Stamps are rounded to the nanosecond, and so is the period taken from them.
        on_grid = (steps > 0) & (np.abs(steps - periods * self._step) <= periods + 1.0)
        self.lost_samples += int((periods[on_grid] - 1.0).sum())
        continues = on_grid & (periods <= _LONGEST_GAP)
        return (np.flatnonzero(~continues) + 1).tolist()

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
    """Measures the control force, fed in blocks of columns of any length."""

    def __init__(self) -> None:
        self._largest: list[tuple[int, float]] = []

    def feed(self, stamp: IntArray, force: FloatArray) -> None:
        """Take the forces that follow: stamps in ns, forces in N, equal lengths."""
        if len(stamp) == 0:
            return
        starts = np.arange(0, len(stamp), _FORCE_BLOCK)
        largest = np.maximum.reduceat(np.abs(force), starts)
        self._largest += zip(stamp[starts].tolist(), largest.tolist(), strict=True)

    @property
    def peak_force(self) -> float | None:
        """Largest magnitude of the force, N; None without forces."""
        return max((force for _, force in self._largest), default=None)

    @property
    def resting_force(self) -> float | None:
        """Largest magnitude over the last tenth of the time, N; None without forces."""
        if not self._largest:
            return None
        first, last = self._largest[0][0], self._largest[-1][0]
        since = last - _RESTING_SHARE * (last - first)
        return max(force for stamp, force in self._largest if stamp >= since)


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
