"""The measures of a window of samples with noise, as functions of it."""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_fit import MeanCycle, fit_mean_cycle
from stickslip_ros.measures.cycle_measures import (
    EQUILIBRIUM_SPEED,
    LEAST_CYCLES,
    STALE_PERIODS,
    STEADY_CHANGE_UNDER_NOISE,
    Cycle,
    CycleMeans,
    Measures,
    Regime,
    Trend,
    without_cycles,
)
from stickslip_ros.measures.folded_cycles import STICKING_SHARE
from stickslip_ros.measures.noise import (
    FEW_SAMPLES,
    FEWEST_SAMPLES,
    LEAST_SAMPLES,
    PRECISION,
    resolved,
    strongest_line,
)
from stickslip_ros.measures.noisy_samples import LastCycles, NoisySamples
from stickslip_ros.measures.segmentation import StickSlip, resting_velocity, stick_slip
from stickslip_ros.measures.single_cycles import LEAST_STICK

REVERSAL = 8.0
"""Least size of a reversal, in standard deviations of the noise."""
_FEW_STEPS = 25.0
"""Amplitude, in steps of an encoder without noise, below which the errors are not known."""
_SHORTEST, _LONGEST = 128, 2048
"""Least and largest number of samples of the last part of a run, unless its cycles are longer."""
_QUANTUM = 1.73
"""Resolution of an encoder with a noise of half of it, in standard deviations of the two."""
_REFINED_SHARE = 0.5
"""Stick fraction up to which a fit of the mean cycle refines it."""
_SAME_VELOCITY, _REST_SHARE = 0.05, 0.2
"""Relative difference of two velocities of a guide that are the same; share of rests on another."""
_SLIP_SHARE = 0.1
"""Share of the belt speed by which a slide at rest may seem to move."""


class NoisyWindow:
    """The last cycles of a run, and what is known of it and of its sensor; SI units."""

    def __init__(self, most_cycles: int) -> None:
        self.most_cycles = most_cycles
        """Number of cycles that a window has if the run is long enough."""
        self.last = LastCycles(most_cycles)
        self.before: LastCycles | None = None
        """Those before a gap, which count until there are enough others; None without."""
        self.run = 0
        """Number of samples of the run so far."""
        self.noise = self.step = 0.0
        """Standard deviation of the noise of the positions, m, and their step; 0 without one."""
        self.within = 0.0
        """Range in which a slide is held as far as its actuator can, m."""
        self.stick_speed = self.fastest_belt = 0.0
        """Relative speed up to which a slide sticks whose friction has a memory, m/s, else 0; and
        largest speed of the belt in the run, m/s."""

    def interrupt(self) -> None:
        """Start a part of the run after a gap."""
        if len(self.last.cycles) >= (1 if self.before is None else LEAST_CYCLES):
            self.before = self.last
        self.last = LastCycles(self.most_cycles)

    @property
    def _recent(self) -> NoisySamples:
        """Samples of the last part of the run, of several cycles if there are any."""
        samples, cycles = self.last.samples, self.last.cycles
        row = len(samples) - min(max(self.run // 4, _SHORTEST), _LONGEST)
        if cycles and 2.0 * cycles[-1].amplitude > self._resolved:
            # What seems to be a last cycle may have ended by noise, long after.
            period = min(cycle.period for cycle in cycles)
            row = min(row, samples.row(float(samples.time[-1]) - LEAST_CYCLES * period))
        return samples[max(row, 0) :]

    @property
    def line(self) -> float | None:
        """Frequency of the line in the spectrum of the last positions, see `strongest_line`."""
        position = self._recent.position
        # An encoder that rounds a steady motion has lines, too.
        if len(position) < FEWEST_SAMPLES:
            return None
        flat = position - np.linspace(position[0], position[-1], len(position))
        least = max(self._resolved, PRECISION * float(np.abs(position).max()))
        return strongest_line(flat) if np.ptp(flat) > least else None

    def measures(self, *, quick: bool = False) -> tuple[Measures, MeanCycle | None]:
        """Return the measures, and the mean cycle if the cycles are alike.

        Rests and slips tell first; the fit of a mean cycle refines short sticks. Where the
        reversals do not show cycles, a line of the spectrum may. With `quick`, rests and slips, or
        means over single cycles, will do.
        """
        segmented = self.stick_slip()
        if segmented is None or segmented.passes:
            return self._by_reversals(quick=quick)
        found = self.segmented(segmented)
        short = segmented.cycle.stick_fraction < _REFINED_SHARE
        if not segmented.rests or (short and not quick):
            refined, fit = self._by_reversals(quick=quick)
            if segmented.agrees(refined):
                return refined, fit
        if not segmented.rests:
            found = replace(found, regime=None, stick_fraction=None)
        return found, None

    def stick_slip(self) -> StickSlip | None:
        """Return the rests and slips that go on at the end of the run; None without them."""
        samples = self.last.samples
        if len(samples) < FEWEST_SAMPLES or self.stick_speed > 0.0:
            return None
        belt = float(samples.belt[-1])
        if float(np.ptp(samples.belt)) > 1e-6 * abs(belt):
            return None
        found = stick_slip(samples.time, samples.position, belt, self.most_cycles, self.step)
        if found is None:
            return None
        since = float(samples.time[-1]) - found.end
        return found if since <= STALE_PERIODS * found.cycle.period else None

    def other_guide(self) -> tuple[float, float] | None:
        """Return the velocity relative to which a slide rests that does not rest on its belt.

        Also the share of the time in which it does. None where there is no other one.
        """
        own, samples, lows = self.stick_slip(), self.last.samples, self.last.lows
        if own is not None and own.rests:
            return None
        samples = samples[samples.row(lows[0].time) if lows else 0 :]
        if len(samples) < FEWEST_SAMPLES:
            return None
        belt = float(samples.belt[-1])
        velocity = resting_velocity(samples.time, samples.position)
        if abs(velocity - belt) <= _SAME_VELOCITY * max(abs(velocity), abs(belt)):
            return None
        found = stick_slip(samples.time, samples.position, velocity, self.most_cycles, self.step)
        share = 0.0 if found is None or not found.rests else found.cycle.stick_fraction
        return (velocity, share) if share > _REST_SHARE else None

    def segmented(self, found: StickSlip) -> Measures:
        """Return the measures of rests and slips."""
        return found.measures(False, *self._trend(found.amplitudes))

    def _by_reversals(self, *, quick: bool = False) -> tuple[Measures, MeanCycle | None]:
        recent, resting, part = self._recent, self.last.resting, self.last
        # Few samples after a gap tell less than the cycles before it.
        enough = len(recent) >= (1 if self.before is None else FEWEST_SAMPLES)
        if enough and 0.0 < self._resolved >= float(np.ptp(recent.position)):
            return self._rest(recent, Regime.HELD), None
        if len(part.cycles) < LEAST_CYCLES and self.before is not None and not resting:
            part = self.before
        line = self.line
        resting |= not part.cycles
        if line is not None and (resting or line * FEW_SAMPLES > 1.0):
            return self._by_line(recent, line)
        if resting:
            # The second half of what has come since the last cycle.
            samples = part.samples
            first = samples.row(part.lows[-1].time) if part.cycles else 0
            return self._rest(samples[(first + len(samples)) // 2 :]), None
        fit = None if quick else self._fit(part.samples, [low.time for low in part.lows])
        if fit is not None:
            return self._found(part.samples, fit, fit.noise), fit
        return self._unlike(part), None

    def _unlike(self, part: LastCycles) -> Measures:
        """Return the measures of cycles that are not alike."""
        # Half of the cycles: a single one may seem to stick for a moment.
        means = CycleMeans.over(part.cycles, 0.5)
        found = self._found(part.samples, means, self.noise)
        fastest = max(cycle.velocity_amplitude for cycle in part.cycles)
        if found.errors and fastest > STICKING_SHARE * self.fastest_belt:
            error = hypot(found.errors["stick_fraction"], LEAST_STICK)
            found = replace(found, errors={**found.errors, "stick_fraction": error})
        return found

    def _by_line(self, samples: NoisySamples, line: float) -> tuple[Measures, MeanCycle | None]:
        """Return the measures of the cycles that a line of the spectrum shows."""
        if line * LEAST_SAMPLES > 1.0:
            return without_cycles(None, Regime.UNDERSAMPLED), None
        time = samples.time
        period = float(time[-1] - time[0]) / (len(time) - 1) / line
        cycles = min(int(float(time[-1] - time[0]) / period), self.most_cycles)
        fit = self._fit(samples, (time[-1] - period * np.arange(cycles, -1.0, -1.0)).tolist())
        if fit is None:
            few = line * FEW_SAMPLES > 1.0
            return without_cycles(None, Regime.UNDERSAMPLED if few else None), None
        return self._found(samples, fit, fit.noise), fit

    def _found(self, samples: NoisySamples, means: CycleMeans, noise: float) -> Measures:
        """Return the measures of cycles in samples with this noise, m."""
        size = means.cycle.amplitude
        if noise < self.step / 2.0 and size < _FEW_STEPS * self.step:
            means = replace(means, errors=None)
        moving = float(samples.belt[-1]) != 0.0
        slow = means.cycle.velocity_amplitude < EQUILIBRIUM_SPEED * self.fastest_belt
        return means.measures(moving and slow, *self._trend(means.amplitudes))

    def _trend(self, amplitudes: FloatArray) -> tuple[bool | None, Trend | None]:
        """Return whether cycles are steady, and how they change."""
        if len(amplitudes) < LEAST_CYCLES:
            return None, None
        trend = trend_under_noise(amplitudes, self.noise, self.step)
        return trend is None, trend

    def _rest(self, samples: NoisySamples, regime: Regime = Regime.EQUILIBRIUM) -> Measures:
        cycles = self.last.cycles
        needed = self.most_cycles * cycles[-1].period if cycles else 0.0
        return rest(samples, self.noise, self._resolved, needed, regime)

    def _fit(self, samples: NoisySamples, starts: Sequence[float]) -> MeanCycle | None:
        if len(starts) <= LEAST_CYCLES:
            return None
        part = samples[samples.row(starts[0]) : samples.row(starts[-1])]
        belt, told = float(np.median(part.belt)), (self.noise, self.step, self.stick_speed)
        if float(np.ptp(part.belt)) > 1e-6 * abs(belt):
            return None
        with np.errstate(over="ignore", invalid="ignore"):  # squares of very large positions
            return fit_mean_cycle(part.time, part.position, belt, np.array(starts), *told)

    @property
    def _resolved(self) -> float:
        """Range of positions, m, within which the sensor or the actuator resolves no motion."""
        return max(resolved(self.step, self.noise), self.within)


def trend_under_noise(amplitudes: FloatArray, noise: float, step: float) -> Trend | None:
    """Return the change of the amplitude over a window of cycles; None without one.

    The line of least squares through the amplitudes shows growth and decay, their range a change to
    and fro; half of what is never to be called steady counts, as the estimate has noise, too.
    """
    mean = float(np.mean(amplitudes))
    least = max(STEADY_CHANGE_UNDER_NOISE * mean, _QUANTUM * noise, step)
    order = np.linspace(-0.5, 0.5, len(amplitudes))
    change = float(order @ (amplitudes - mean) / (order @ order))
    if abs(change) > least / 2.0:
        return Trend.GROWING if change > 0.0 else Trend.DECAYING
    return Trend.VARYING if float(np.ptp(amplitudes)) > 0.8 * least else None


def rest(
    samples: NoisySamples, noise: float, resolved: float, needed: float, regime: Regime
) -> Measures:
    """Return the measures of a motion without cycles, steady once it lasts for `needed` s.

    The amplitude is that of a sine whose variance is what that of the positions exceeds the noise
    by. A slide that moves on by more than is `resolved`, m, by a line through the positions, or
    to and fro from sample to sample, has no regime.
    """
    none = without_cycles(None, None)
    if len(samples) < 8:
        return none
    time = samples.time - samples.time[0]
    belt_speed = abs(float(samples.belt[-1]))
    slope = float(np.polyfit(time, samples.position - samples.position[0], 1)[0])
    spread = float(np.std(samples.position))
    far = max(resolved, REVERSAL * noise, PRECISION * abs(samples.position[0]))
    if abs(slope) > _SLIP_SHARE * belt_speed and abs(slope) * float(time[-1]) > far:
        return none
    amplitude = sqrt(2.0 * max(spread**2 - noise**2, 0.0))
    speed = float(np.std(np.diff(samples.position))) * (len(time) - 1) / max(float(time[-1]), 1e-9)
    if amplitude > far and speed > _SLIP_SHARE * belt_speed > 0.0:
        return none
    at_rest = Cycle(
        amplitude=amplitude,
        velocity_amplitude=0.0,
        midpoint=float(np.mean(samples.position)),
        period=0.0,
        frequency=0.0,
        stick_fraction=0.0 if belt_speed > 0.0 else 1.0,
    )
    regime = regime if belt_speed > 0.0 else Regime.STUCK
    steady = float(time[-1]) * 2.0 >= needed or regime is Regime.HELD or None
    found = without_cycles(at_rest, regime, steady=steady)
    return replace(found, velocity_amplitude=None)  # the positions do not tell it
