"""Measures from samples: stamps become time and losses, samples become knots, knots cycles."""

from typing import Any

import numpy as np
import numpy.typing as npt

from stickslip_ros.physics.knots import FloatArray, Knots, knots_from_samples
from stickslip_ros.physics.measures import UNBOUNDED_BELT_SPEEDS, Cycle, CycleMeter, Measures

IntArray = npt.NDArray[np.int64]

_LONGEST_GAP = 10
"""Periods over which a motion may still be interpolated."""

_RESTING_SHARE = 0.1
_FORCE_BLOCK = 256


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
        self._last: tuple[IntArray, FloatArray, FloatArray, FloatArray] | None = None
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
        columns = (stamp, position, velocity, belt_velocity)
        finite = np.isfinite(position) & np.isfinite(velocity) & np.isfinite(belt_velocity)
        if not finite.all():
            columns = tuple(column[finite] for column in columns)
        self.samples += len(columns[0])
        if self._last is not None:
            columns = tuple(
                np.concatenate([old, new]) for old, new in zip(self._last, columns, strict=True)
            )
        if len(columns[0]) == 0:
            return []
        cycles: list[Cycle] = []
        starts = self._segment_starts(columns[0])
        for start, end in zip([0, *starts], [*starts, len(columns[0])], strict=True):
            if start > 0:
                self._begin_segment()
            cycles += self._feed_segment(*(column[start:end] for column in columns))
        self._last = tuple(column[-1:] for column in columns)
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

    def _feed_segment(
        self,
        stamp: IntArray,
        position: FloatArray,
        velocity: FloatArray,
        belt_velocity: FloatArray,
    ) -> list[Cycle]:
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
