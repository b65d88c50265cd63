"""The measures of a motion from its samples."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import copysign, inf
from typing import NamedTuple, Protocol

import numpy as np

from stickslip_ros.arrays import FloatArray, median
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.breakpoints import STICK_SHARE, Breakpoints, breakpoints_from_samples
from stickslip_ros.measures.cycle_measures import (
    UNBOUNDED_BELT_SPEEDS,
    Cycle,
    Measures,
    Regime,
    with_drift,
    without_cycles,
)
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.measures.drift import Drift
from stickslip_ros.measures.mean_cycle import MeanCycle
from stickslip_ros.measures.noise import FEW_SAMPLES
from stickslip_ros.measures.sample_assumptions import EXACT, SampleAssumptions
from stickslip_ros.measures.sample_window import Window, WindowMeter
from stickslip_ros.measures.sampling_grid import LONGEST_GAP, SamplingGrid
from stickslip_ros.measures.window_measures import (
    line,
    measure,
    other_guide,
    rests_and_slips,
    segmented_measures,
)
from stickslip_ros.samples import SampleColumns
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import quantity

_LASTING_SAMPLES = 4
"""Number of fast samples in one direction that are no impulse of a noisy record."""
_LEAST_ERRORS, _LEAST_SHARE = 4.0, 1e-3
"""Difference between the velocities of stick and belt, in standard errors and in belt speeds, above
which they disagree."""
_EDGE_ERROR = 0.03
"""Standard error of the stick of a cycle of exact samples, in sample periods: its edges are
interpolated, and the rounding is alike in all cycles."""

_MOST_HIDDEN, _BETWEEN_SAMPLES = 0.05, 0.3
"""Standard error of a stick fraction of 0 above which a note tells what may be hidden; those
of amplitude and midpoint, in amplitudes, of slips between two samples."""

_FEW_STRAYS, _STRAY_SHARE = 10, 0.01
"""Number and share of samples off the grid of the plant up to which it may have been restarted."""

NOT_JUDGED = "belt, load, disturbance or reference vary: a drift is not judged"
"""Note on measures that do not say whether they drift."""


@dataclass(frozen=True)
class MeasuredMotion:
    """Breakpoints that continue a motion, and the cycles measured with them."""

    breakpoints: Breakpoints
    belt_velocity: FloatArray
    """Velocity of the belt at each breakpoint, m/s."""
    cycles: Sequence[Cycle]
    """Cycles completed by these breakpoints."""
    cycle_ends: Sequence[float]
    """Time at which each of these cycles ended, s."""
    longest_step: float = inf
    """Longest time between two breakpoints, s, over which the motion between them is known."""


class MotionObserver(Protocol):
    """Receives a motion as it is measured; times in s from the start of the run, SI units."""

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Receive the motion that follows."""


class MeasuredSamples(NamedTuple):
    """What samples tell of a motion."""

    measures: Measures
    """Means over the last whole cycles."""
    notes: Sequence[str]
    """Sentences that say why the measures may be wrong."""
    mean_cycle: MeanCycle | None
    """Fit to the cycles; None for exact samples and cycles that are not alike."""


class _Speeds:
    """Extremes of the speeds so far, m/s."""

    def __init__(self) -> None:
        self.belt = self.slip = self.slide = 0.0
        self.lasting = 0.0  # of the slide since the belt moves: what it was before tells nothing
        self.belt_varies = False

    def follow(self, samples: SampleColumns, count: int) -> None:
        """Add samples; a speed lasts for so many of them."""
        belt_speed, speed = np.abs(samples.belt_velocity), np.abs(samples.velocity)
        self.belt_varies |= bool(np.ptp(belt_speed) > 1e-6 * belt_speed[0])
        velocity = samples.velocity[np.logical_or.accumulate(belt_speed + self.belt > 0.0)]
        self.belt = max(self.belt, float(belt_speed.max()))
        self.slide = max(self.slide, float(speed.max()))
        if len(velocity) >= count:
            following = [velocity[row : len(velocity) - count + 1 + row] for row in range(count)]
            least, most = np.minimum.reduce(following), np.maximum.reduce(following)
            self.lasting = max(self.lasting, float(least.max()), -float(most.min()))


class SampleMeter:
    """Measures a motion from its samples, fed in blocks of columns of any length.

    A gap of up to ten sample periods is bridged, and what is missing in it is lost. A longer one is
    a loss if it is a whole number of periods, up to ten million. Any other gap, and a stamp that
    goes back, starts a new segment and is not a loss. Stamps on no grid, for example those read
    from a clock, are measured, too.
    """

    def __init__(
        self,
        window: int,
        observer: MotionObserver | None = None,
        *,
        reading: SampleAssumptions = EXACT,
    ) -> None:
        """Average over the last `window` cycles at most; an `observer` receives the motion.

        `reading` says how the samples are to be read, and may change as more is known of them.
        Raises InvalidInputError if its stick speed is negative or not finite.
        """
        speed = reading.stick_speed
        if speed is not None and not 0.0 <= speed < inf:
            raise InvalidInputError(
                f"stick_speed = {speed} is invalid: must be finite and at least 0 (m/s)"
            )
        self.reading = reading
        self.origin = 0
        """Stamp of time zero for the observer, ns."""
        self.samples = 0
        """Number of samples so far."""
        self.first = inf
        """Stamp of the first one, ns; infinite before it."""
        self.drift = Drift()
        """Trends of the run; those of the control force are for its user to feed."""
        self._observer = observer
        self._grid, self._elapsed = SamplingGrid(), 0
        self._meter, self._window = CycleMeter(window), WindowMeter(window)
        self._last: SampleColumns | None = None
        self._speeds = _Speeds()
        self._per_cycle = inf  # samples of the last cycle of exact samples

    def feed(self, samples: SampleColumns) -> list[Cycle]:
        """Add the samples that follow; return the cycles completed by them.

        Samples that are not valid, see `SampleColumns.is_valid`, count as lost. Those with stamp
        and position of the one before are left out.
        """
        samples, known = samples[samples.is_valid], 0
        if self._last is not None:
            samples, known = self._last.followed_by(samples), 1
        again = (np.diff(samples.stamp) == 0) & (np.diff(samples.position) == 0.0)
        if again.any():
            samples = samples[np.append(True, ~again)]
        self.samples += len(samples) - known
        if len(samples) == known:
            return []
        self.first = min(self.first, float(samples.stamp[0]))
        cycles: list[Cycle] = []
        starts = [0, *self._grid.cuts(samples.stamp, self.reading.period)]
        for start, end in zip(starts, [*starts[1:], len(samples)], strict=True):
            segment = samples[start:end]
            # Impulses go back.
            self._speeds.follow(segment, _LASTING_SAMPLES if self.noisy else 1)
            if len(segment) == 1 and end < len(samples):
                continue  # a single sample is no motion, and there may be very many of them
            if start > 0:
                self._meter.interrupt()
                self._window.interrupt()
                self._last = None
            cycles += self._feed_segment(segment)
        self._last = samples[-1:]
        return cycles

    @property
    def mixed(self) -> bool:
        """Whether the samples are those of several plants, whose motion is not known."""
        return self._grid.strays > max(_FEW_STRAYS, _STRAY_SHARE * self.samples)

    @property
    def lost_samples(self) -> int:
        """Number of missing samples, from the stamps."""
        return self._grid.lost

    @property
    def duration(self) -> float:
        """Simulated time covered, s."""
        return self._elapsed * 1e-9

    @property
    def noisy(self) -> bool:
        """Whether the samples have noise, as far as it is known."""
        return self._window.noisy if self.reading.noisy is None else self.reading.noisy

    @property
    def position_noise(self) -> float | None:
        """Standard deviation of the noise of the positions, m; None for exact samples."""
        return self._window.noise if self.noisy else None

    @property
    def step(self) -> float:
        """Step of the encoder, m; 0 without one."""
        return self._window.step

    @property
    def other_guide(self) -> tuple[float, float] | None:
        """Velocity, m/s, relative to which the slide rests, if it is not that of the belt.

        Behind it is the share of the time in which it does; None where there is none.
        """
        return other_guide(self._window.window(), self._known)

    def measures(self, *, quick: bool = False) -> Measures:
        """Return the measures as `measured` does."""
        return self.measured(quick=quick).measures

    def measured(self, length: str = "m", *, quick: bool = False) -> MeasuredSamples:
        """Return the means over the last whole cycles, and why they may be wrong.

        `length` is the unit of positions in the notes, "" for none. With `quick`,
        cycles under noise are measured one by one instead of together, which takes a thousandth of
        the time and is less accurate.
        """
        if self.mixed:
            note = (
                f"{self._grid.strays} of {self.samples} samples are not whole periods after the "
                "one before, as where several plants publish on one topic: motion, duration and "
                "lost samples are not known"
            )
            return MeasuredSamples(without_cycles(None, None), [note], None)
        window, mean = self._window.window(), None
        few = not self.noisy and self._per_cycle < FEW_SAMPLES and line(window, self._known)
        if self._unbounded:
            measures = without_cycles(None, Regime.UNBOUNDED, steady=True)
        elif self.noisy or few:
            measures, mean = measure(window, self._known, quick=quick)
        else:
            measures = self._exact_measures(window)
        varies = self.reading.varies or self._speeds.belt_varies
        measures = measures if varies else with_drift(measures, self.drift)
        notes = [*self._notes(measures, mean, length), *[NOT_JUDGED] * varies]
        return MeasuredSamples(measures, notes, mean)

    @property
    def _unbounded(self) -> bool:
        """Whether the motion diverges."""
        limit = UNBOUNDED_BELT_SPEEDS * self._speeds.belt
        # The last sample of a plant whose motion diverges has just that speed.
        ended = self._speeds.slide >= (1.0 - 1e-9) * self.reading.unbounded_speed
        return ended or self._speeds.lasting > limit > 0.0

    def _exact_measures(self, window: Window) -> Measures:
        """Return the measures of breakpoints, or those of rests and slips that contradict them."""
        measures = self._meter.measures()
        # The velocities of other machines are filtered, and those on a guide at rest are not those
        # of a belt.
        may_rest = self.reading.noisy is None or self._speeds.belt == 0.0
        rests = rests_and_slips(window, self._known) if may_rest else None
        if rests is not None and not rests.passes and not rests.agrees(measures):
            # Rests that are not sure contradict pure slip and another period, and no other stick.
            sticks = measures.stick_fraction and rests.same_period(measures)
            if rests.rests or not sticks:
                return segmented_measures(window, rests)
        if measures.errors is not None and measures.stick_fraction:
            error = max(measures.errors["stick_fraction"], _EDGE_ERROR / self._per_cycle)
            measures = replace(measures, errors={**measures.errors, "stick_fraction": error})
        return measures

    def _notes(self, measures: Measures, mean: MeanCycle | None, length: str) -> Iterator[str]:
        """Yield sentences that say why the measures may be wrong."""
        if self._grid.steps_back:
            yield (
                f"the stamp of {self._grid.steps_back} of {self.samples} samples is not later than "
                "the one before, and the motion is cut there: the plant was restarted, or the "
                "samples of several plants are mixed"
            )
        if self.step and measures.amplitude and measures.cycles > 2 and measures.errors is None:
            yield (
                f"the amplitude is only {measures.amplitude / self.step:.2g} steps of the encoder: "
                "the standard errors are not known"
            )
        errors, most = measures.errors or {}, _BETWEEN_SAMPLES * (measures.amplitude or 0.0)
        # Of cycles that grow or decay the amplitude has a large error, the midpoint has not.
        unsure = min(errors.get(name, 0.0) for name in ("amplitude", "midpoint")) > most
        if unsure and measures.regime is Regime.STICK_SLIP:
            yield (
                "the slips last for about one sample: the amplitude has a large error, and "
                "positions that are held between updates look the same"
            )
        hidden = errors.get("stick_fraction", 0.0)
        if measures.regime is Regime.PURE_SLIP and hidden > _MOST_HIDDEN:
            yield f"noise or few samples may hide sticks of up to {2.0 * hidden:.0%} of a cycle"
        if measures.regime is None and measures.period is not None:
            yield (
                "the regime is not known: the positions do not tell whether the slide rests in its "
                "cycles, or for a moment at the speed of the belt, or moves slowly"
            )
        belt = self._last.belt_velocity[-1] if self._last else 0.0
        if mean is not None and mean.stick is not None:
            velocity, error = copysign(mean.stick.fit.belt_speed, belt), mean.stick.speed_error
            if abs(velocity - belt) > _LEAST_ERRORS * error + _LEAST_SHARE * abs(belt):
                speed = length and f"{length}/s"
                yield (
                    f"the slide sticks at {quantity(velocity, speed)} (standard error "
                    f"{quantity(error, speed)}), not at the speed of the belt, "
                    f"{quantity(belt, speed)}: one of them has another scale, or the positions "
                    "drift; the stick is that at the former"
                )

    @property
    def _known(self) -> SampleAssumptions:
        """What is known of the samples, with a stick speed."""
        speed = self.reading.stick_speed
        if speed is None:
            speed = STICK_SHARE * (self._speeds.belt or self._speeds.slip)
        return self.reading._replace(stick_speed=speed)

    @property
    def _by_reversals(self) -> bool:
        """Whether single cycles are those of reversals: velocities do not tell a rest."""
        return self.noisy or (self.reading.noisy is None and self._speeds.belt == 0.0)

    def _feed_segment(self, samples: SampleColumns) -> list[Cycle]:
        """Feed the meters with samples that continue the motion, from the last one fed on."""
        stamp, belt = samples.stamp, samples.belt_velocity
        time = (stamp - stamp[0] + float(self._elapsed)) * 1e-9
        self._elapsed += int(stamp[-1] - stamp[0])
        new = slice(0 if self._last is None else 1, None)
        self.drift.position.feed(time[new], samples.position[new])
        self._speeds.slip = max(self._speeds.slip, float(np.abs(samples.velocity - belt).max()))
        breakpoints, cycles = None, list[Cycle]()
        # The samples may be exact, or an observer wants breakpoints.
        if not self.reading.noisy or self._observer is not None:
            breakpoints = self._breakpoints(samples, time)
            self._meter.within = self.reading.within
            cycles = self._meter.feed(breakpoints, float(belt[-1]), self._speeds.belt)
            if cycles and len(time) > 1:
                self._per_cycle = cycles[-1].period / median(np.diff(time))
        # For samples with noise, few in a cycle, or beside a guide at rest.
        few = self._per_cycle < FEW_SAMPLES
        if self.reading.noisy is not False or self._speeds.belt == 0.0 or few:
            under_noise = self._window.feed(
                time[new], samples.position[new], samples.velocity[new], belt[new]
            )
            cycles = under_noise if self._by_reversals else cycles
            self.drift.resolution = self.step
        ends = (self._window if self._by_reversals else self._meter).ends
        self.drift.feed_cycles(ends, cycles)
        if self._observer is not None and breakpoints is not None:
            observed = (stamp - self.origin) / NANOSECONDS
            # Rounding may put a breakpoint after the last sample.
            rows = np.minimum(np.searchsorted(time, breakpoints.time), len(time) - 1)
            self._observer.take_motion(
                MeasuredMotion(
                    replace(breakpoints, time=np.interp(breakpoints.time, time, observed)),
                    belt[rows],
                    cycles,
                    (np.array(ends) + (observed[0] - time[0])).tolist(),
                    LONGEST_GAP * median(np.diff(observed)) if len(observed) > 1 else inf,
                )
            )
        return cycles

    def _breakpoints(self, samples: SampleColumns, time: FloatArray) -> Breakpoints:
        """Return the breakpoints of samples at these times, s, behind those fed before."""
        with np.errstate(over="ignore", invalid="ignore"):
            breakpoints = breakpoints_from_samples(
                time,
                samples.position,
                samples.velocity,
                samples.belt_velocity,
                stick_speed=self._known.stick_speed or 0.0,
                exact_times=self._grid.on_grid(np.diff(samples.stamp)),
            )
        # The first sample was fed with the previous block.
        return breakpoints if self._last is None else breakpoints[1:]
