"""Measures from samples: stamps give time and losses, samples breakpoints, and these cycles."""

from dataclasses import replace
from itertools import islice
from math import inf, isfinite
from statistics import median
from typing import Any, NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.physics.measures.breakpoints import breakpoints_from_samples
from stickslip_ros.physics.measures.cycles import UNBOUNDED_BELT_SPEEDS, Cycle, CycleMeter, Measures
from stickslip_ros.physics.measures.observer import MeasuredMotion, MotionObserver, RunObserver
from stickslip_ros.stamps import NANOSECONDS

LONGEST_GAP = 10
"""Periods over which a motion may still be interpolated."""

_FEW_STEPS = 10
"""Steps after which the period is taken as known."""

_LONGEST_STEP = 86_400 * NANOSECONDS
"""A longer step is neither a period nor a loss: one of the two stamps is not of this run."""

_LONGEST_LOSS = 10**7
"""Periods up to which a gap on the grid may be a loss."""

_LEAST_AHEAD = 64
"""Steps looked at together, where as many came."""

_STEADY_STEPS = 1000
"""Steps on a grid after which one that leaves it is no sign of jitter."""

_SHORT_GAP = 5
"""By this factor at most a jittered step is longer or shorter than a period."""

_FEW_GAPS = 3
"""So many short gaps off the grid, none of them behind steady steps, are jitter."""

LARGEST = 1e100
"""Magnitude up to which positions (m) and speeds (m/s) are believed, and nothing overflows."""

_RESTING_PART = 10
"""The force at rest is that of the last tenth of the time."""

HELD_FORCES = 20_000
"""Forces behind which it may still be told of one that it did not act."""


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


class _Segment(NamedTuple):
    """What of a block belongs together: all from `start` up to the next one's."""

    start: int
    jittered: bool


class _JitteredSteps:
    """Steps that vary about a period, as those between readings of a clock do."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._count = 0
        self._missing = 0
        self._single_count = 0
        self._single_time = 0
        self._next_estimate = _FEW_STEPS

    @property
    def lost(self) -> int:
        """How many samples are missing; a late one and one in time behind it make up a loss."""
        return max(self._missing, 0)

    def follow(self, steps: IntArray) -> int:
        """Follow some of the steps (ns) up to the next gap; return how many, none at a gap."""
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


class _Grid:
    """The grid of instants that samples are on, found from their stamps, and what it misses.

    Stamps are rounded to the nanosecond. The period is known all the better the more of it were
    seen, so that a long gap of a whole number of periods can be told from one between segments.
    Stamps that soon leave the grid again and again are on none: their steps are jittered.
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
        """How many instants of the grid had no sample."""
        lost = self._lost_before + self._periods - self._intervals
        return lost if self._jittered is None else lost + self._jittered.lost

    def segments(self, stamp: IntArray) -> list[_Segment]:
        """Follow the stamps (ns), the first of them known; return what the motion is cut into.

        It is cut where a new segment begins, which is no loss, and behind a gap that is too long
        to interpolate over. The first of them goes on from before.
        """
        steps = np.diff(stamp)
        segments = [_Segment(0, self._jittered is not None)]
        done = 0
        while done < len(steps):
            followed = self._follow(steps[done:])
            done += followed
            if followed > 0 or self._reconsider(int(steps[done])):
                continue
            self._jump(int(steps[done]))
            done += 1
            segments.append(_Segment(done, self._jittered is not None))
        return segments

    def _follow(self, steps: IntArray) -> int:
        """Follow some of the steps up to the next that is odd; return how many."""
        if self._jittered is not None:
            return self._jittered.follow(steps)
        if self._step == 0:
            self._step = int(steps[0])
        # To look further ahead than came since the last gap could take quadratic time.
        steps = steps[: max(_LEAST_AHEAD, self._since_gap)]
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
        """Take the first few steps for several periods each if a shorter one fits into them."""
        times = round(self._step / step) if step > 0 else 0
        fits = 1 < times <= _LONGEST_LOSS and abs(self._step - times * step) <= times + 1
        if not fits or self._intervals > _FEW_STEPS:
            return False
        self._periods *= times
        self._step = step
        return True

    def _jump(self, gap: int) -> None:
        """Count a long gap as loss if it is on the grid, otherwise begin a new one."""
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
        """Return what comes behind a gap off the grid if that was left too often."""
        if self._intervals > _STEADY_STEPS:
            self._off_grid.clear()
        period = self._covered / self._periods if self._periods > 0 else 0.0
        if not 0.0 < period / _SHORT_GAP <= gap <= _SHORT_GAP * period:
            self._off_grid.clear()
            return None
        self._off_grid += [period, gap]
        if len(self._off_grid) < 2 * _FEW_GAPS:
            return None
        steps = _JitteredSteps(median(self._off_grid))
        self._off_grid.clear()
        return steps


def _first(found: BoolArray) -> int:
    """Return the first row that is true, or their number if none is."""
    return int(np.argmax(found)) if found.any() else len(found)


class SampleMeter:
    """Measures a motion from its samples, fed in blocks of columns of any length.

    A gap of a whole number of sample periods is loss, up to ten million of them; any other, and a
    stamp that goes back, is the start of a new segment and not lost. Stamps that are on no grid,
    as those read from a clock, are measured too: then what is missing between two samples is loss
    up to ten periods, and beyond that a new segment starts.
    """

    def __init__(self, window: int, observer: MotionObserver | None = None) -> None:
        """Average over the last `window` cycles at most; an `observer` sees what is measured."""
        self.origin = 0
        """Stamp, ns, from which the observer's times count."""
        self.samples = 0
        """Samples seen."""
        self._observer = observer
        self.steps_back = 0
        """Samples whose stamp was not later than the one before."""
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

        Rows that are not finite, or of more than 1e100 m or m/s, count as lost. Return the cycles
        completed by them.
        """
        believed = np.ones(len(stamp), dtype=bool)
        for column in (position, velocity, belt_velocity):
            believed &= np.abs(column) <= LARGEST
        rows = _Rows(stamp, position, velocity, belt_velocity).select(believed)
        self.samples += len(rows.stamp)
        if self._last is not None:
            rows = self._last.followed_by(rows)
        if len(rows.stamp) == 0:
            return []
        self.steps_back += int((np.diff(rows.stamp) <= 0).sum())
        cycles: list[Cycle] = []
        segments = self._grid.segments(rows.stamp)
        ends = [*(segment.start for segment in segments[1:]), len(rows.stamp)]
        for (start, jittered), end in zip(segments, ends, strict=True):
            segment = rows.select(slice(start, end))
            self._look_for_run_away(segment)
            if len(segment.stamp) == 1 and end < len(rows.stamp):
                continue  # a lone sample is no motion, and there may be very many of them
            if start > 0:
                self._meter.interrupt()
                self._last = None
            cycles += self._feed_segment(segment, jittered)
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

    def _feed_segment(self, rows: _Rows, jittered: bool) -> list[Cycle]:
        stamp, position, velocity, belt_velocity = rows
        time = (stamp - stamp[0] + float(self._elapsed)) * 1e-9
        self._elapsed += int(stamp[-1] - stamp[0])
        with np.errstate(over="ignore", invalid="ignore"):
            breakpoints = breakpoints_from_samples(
                time, position, velocity, belt_velocity, exact_times=not jittered
            )
        if self._last is not None:
            breakpoints = breakpoints[1:]  # the sample carried over was fed with its own block
        cycles = self._meter.feed(breakpoints, float(belt_velocity[-1]))
        if self._observer is not None:
            observed = (stamp - self.origin) / NANOSECONDS
            # A breakpoint's time may be rounded beyond that of the last sample.
            ends = np.minimum(np.searchsorted(time, breakpoints.time), len(time) - 1)
            known = LONGEST_GAP * float(np.median(np.diff(observed))) if len(observed) > 1 else inf
            self._observer.take_motion(
                MeasuredMotion(
                    replace(breakpoints, time=np.interp(breakpoints.time, time, observed)),
                    belt_velocity[ends],
                    cycles,
                    np.interp(self._meter.ends, time, observed).tolist(),
                    known,
                )
            )
        return cycles

    def _look_for_run_away(self, rows: _Rows) -> None:
        belt_speed = np.abs(rows.belt_velocity)
        if np.any(np.abs(rows.velocity) > UNBOUNDED_BELT_SPEEDS * belt_speed) and belt_speed.all():
            self._meter.report_run_away()


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


class SettledForces(NamedTuple):
    """Forces that were sent, and whether each acted: columns of equal lengths."""

    stamp: IntArray
    """ns"""
    force: FloatArray
    """N"""
    acted: BoolArray

    def select(self, rows: slice) -> Self:
        """Return some of them."""
        return type(self)(self.stamp[rows], self.force[rows], self.acted[rows])


class DroppedForces:
    """Forces that are known to have been dropped, each until it is found among those sent."""

    def __init__(self) -> None:
        self._number: dict[tuple[int, float], int] = {}

    def add(self, stamp: IntArray, force: FloatArray) -> None:
        """Take forces (ns, N) that were dropped; what is not finite never acts anyway."""
        for dropped in zip(stamp.tolist(), force.tolist(), strict=True):
            if isfinite(dropped[1]):
                self._number[dropped] = self._number.get(dropped, 0) + 1
        for oldest in list(islice(self._number, max(0, len(self._number) - HELD_FORCES))):
            del self._number[oldest]

    def among(self, stamp: IntArray, force: FloatArray) -> IntArray:
        """Return the rows of forces sent (ns, N) that were dropped: as many of equal ones."""
        if not self._number:
            return np.empty(0, np.int64)
        rows: list[int] = []
        for row in np.flatnonzero(np.isin(stamp, [stamp for stamp, _ in self._number])).tolist():
            sent = int(stamp[row]), float(force[row])
            if sent in self._number:
                rows.append(row)
                self._number[sent] -= 1
                if self._number[sent] == 0:
                    del self._number[sent]
        return np.array(rows, np.int64)


class ForceSettler:
    """Tells which of the forces that were sent acted, from those that were dropped.

    A force and the news that it was dropped may come in either order, some 20,000 forces apart.
    """

    def __init__(self) -> None:
        self._held = SettledForces(np.empty(0, np.int64), np.empty(0), np.empty(0, np.bool_))
        self._dropped = DroppedForces()

    def feed(
        self,
        stamp: IntArray,
        force: FloatArray,
        dropped_stamp: IntArray,
        dropped_force: FloatArray,
    ) -> SettledForces:
        """Take forces (ns, N) that were sent, and that were dropped; return what is settled."""
        held = self._held
        self._held = SettledForces(
            np.concatenate([held.stamp, stamp]),
            np.concatenate([held.force, force]),
            np.concatenate([held.acted, np.isfinite(force)]),
        )
        self._dropped.add(dropped_stamp, dropped_force)
        undecided = np.where(self._held.acted, self._held.force, np.nan)
        self._held.acted[self._dropped.among(self._held.stamp, undecided)] = False
        return self._release(len(self._held.stamp) - HELD_FORCES)

    def finish(self) -> SettledForces:
        """Return what was held back: no more is told of it."""
        return self._release(len(self._held.stamp))

    def _release(self, number: int) -> SettledForces:
        number = max(number, 0)
        held = self._held
        self._held = held.select(slice(number, None))
        return held.select(slice(number))


class RunMeter:
    """Measures a run from what is recorded of it: the samples and the control force."""

    def __init__(
        self, window: int, *, dropped_known: bool = False, observer: RunObserver | None = None
    ) -> None:
        """Average over the last `window` cycles at most; an `observer` sees motion and forces.

        `dropped_known` says whether it is told which forces were dropped; only then it is known
        which acted.
        """
        self.motion = SampleMeter(window, observer)
        self.force = ForceMeter()
        """The force as it was sent."""
        self.applied = ForceMeter()
        """The force that acted; one that was dropped counts as none."""
        self.dropped_known = dropped_known
        self.dropped = 0
        """Forces that were told to be dropped."""
        self._settler = ForceSettler()
        self._observer = observer

    def feed_forces(
        self,
        stamp: IntArray,
        force: FloatArray,
        dropped_stamp: IntArray,
        dropped_force: FloatArray,
    ) -> SettledForces:
        """Take the forces that follow, sent and dropped; return those of which it is settled.

        See `ForceMeter` for stamps and forces, and `ForceSettler`.
        """
        self.force.feed(stamp, force)
        self.dropped += len(dropped_stamp)
        return self._apply(self._settler.feed(stamp, force, dropped_stamp, dropped_force))

    def finish(self) -> SettledForces:
        """End the run: what was not told to be dropped has acted. Return these forces."""
        return self._apply(self._settler.finish())

    def _apply(self, settled: SettledForces) -> SettledForces:
        self.applied.feed(settled.stamp, np.where(settled.acted, settled.force, 0.0))
        if self._observer is not None:
            time = (settled.stamp - self.motion.origin) / NANOSECONDS
            self._observer.take_control(time, settled.force, settled.acted)
        return settled

    def report(self) -> dict[str, Any]:
        """Return the measures and counts by name, ready for JSON; SI units.

        `notes` are sentences on what makes the measures doubtful.
        """
        motion = self.motion
        notes: list[str] = []
        if motion.steps_back:
            notes.append(
                f"the stamp of {motion.steps_back} of {motion.samples} samples is not later than "
                "the one before, and the motion is cut there: the plant was started anew, or "
                "several nodes publish joint_states"
            )
        return {
            **motion.measures().as_dict(),
            "peak_force": self.force.peak_force,
            "resting_force": self.force.resting_force,
            "peak_applied_force": self.applied.peak_force if self.dropped_known else None,
            "resting_applied_force": self.applied.resting_force if self.dropped_known else None,
            "dropped_forces": self.dropped if self.dropped_known else None,
            "samples": motion.samples,
            "lost_samples": motion.lost_samples,
            "duration": motion.duration,
            "notes": notes,
        }
