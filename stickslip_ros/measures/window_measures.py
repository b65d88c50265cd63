"""The measures of a window of positions with noise: `measure`, a function of the window.

The first of these that can tells them:

1. Rests and slips (`segmentation`) of a slide that rests. Below a stick fraction of a half, and of
   slips with many samples, what 3, 5 or 6 tells counts instead if it agrees: it is more exact.
2. A slide within the resolution of its sensor or actuator is held.
3. The mean cycle (`mean_cycle`) of a line of the spectrum, where few samples or noise hide turns.
4. A slide without reversals for several periods is at rest.
5. The mean cycle of cycles between reversals that are alike.
6. Means over single cycles (`single_cycles`).

No regime is told of a slide that passes the speed of the belt or may rest where it turns.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import hypot, inf, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import (
    EQUILIBRIUM_SPEED,
    LEAST_CYCLES,
    STALE_PERIODS,
    STEADY_CHANGE_UNDER_NOISE,
    STICKING_SHARE,
    Cycle,
    CycleMeans,
    Measures,
    Regime,
    Trend,
    undecided,
    without_cycles,
)
from stickslip_ros.measures.mean_cycle import MeanCycle, fit_mean_cycle
from stickslip_ros.measures.noise import (
    FEW_SAMPLES,
    FEWEST_SAMPLES,
    LEAST_SAMPLES,
    PRECISION,
    resolved,
    strongest_line,
)
from stickslip_ros.measures.rests import moves, resting_velocity
from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.measures.sample_window import REVERSAL, Window
from stickslip_ros.measures.segmentation import StickSlip, stick_slip
from stickslip_ros.measures.single_cycles import LEAST_STICK, NoisySamples

_FEW_STEPS = 25.0
"""Amplitude, in steps of an encoder without noise, below which the errors are not known."""
_SHORTEST, _LONGEST = 128, 2048
"""Least and largest number of samples of the last part of a run, unless its cycles are longer."""
_QUANTUM = 1.73
"""Resolution of an encoder with a noise of half of it, in standard deviations of the two."""
_REFINED_SHARE = 0.5
"""Stick fraction up to which a fit of the mean cycle refines it."""
_LEAST_SLIP, _APART = 12.0, 4.0
"""Samples in a slip from which it does; errors of a stick fraction within which both agree."""
_REST_SHARE = 0.2
"""Share of the time in which a slide rests on another guide than its belt."""
_UNLIKE, _UNLIKE_SLIPS = 0.2, 0.35
"""Standard error of the mean period, in periods, above which cycles have nothing in common; of
cycles without a stick, the standard deviation of their periods."""
_STAND = 2.0
"""Length of a stand of a slide on a guide at rest, in stands between its moves, from which it is
stuck."""
_RIPPLE = 4.0
"""Range of the middles of cycles, and beside their line that of all middles, in amplitudes, above
which they are ripples."""
_OTHER_SPEED = 0.1
"""Share of the belt speed by which that of a stick differs at most."""
_SLIP_SHARE = 0.1
"""Share of the belt speed by which a slide at rest may seem to move."""
_MOST_NEAR = 0.4
"""Share of the samples near an extreme above which a rest there is hidden."""
_NEAR_STEPS, _LEAST_DWELL, _DWELL_GROWTH = 4.0, 4.0, 1.25
"""Distance from an extreme, in steps, that is near; number of samples near it that tell a rest;
growth of their number with four times the distance below which they do: it is two in a parabola."""


def measure(
    window: Window, reading: SampleAssumptions, *, quick: bool = False
) -> tuple[Measures, MeanCycle | None]:
    """Return the measures, with errors, and the mean cycle if it was fitted and the cycles alike.

    `reading` is what is known of the samples, with a stick speed. With `quick`, rests and slips, or
    means over single cycles, will do.
    """
    segmented = rests_and_slips(window, reading)
    if segmented is None or segmented.passes:
        measures, fit = _by_reversals(window, reading, quick=quick)
        return _undecided_if_doubtful(window, measures, fit), fit
    short = segmented.cycle.stick_fraction < _REFINED_SHARE
    short &= segmented.slip_samples >= _LEAST_SLIP
    if not segmented.rests or (short and not quick):
        refined, fit = _by_reversals(window, reading, quick=quick)
        if segmented.agrees(refined):
            return _undecided_if_doubtful(window, _not_surer(refined, segmented), fit), fit
    return segmented_measures(window, segmented), None


def _undecided_if_doubtful(window: Window, measures: Measures, fit: MeanCycle | None) -> Measures:
    """Return measures without a regime where a rest may be hidden, or may be none.

    It may be hidden where the slide passes the speed of the belt, and where it turns on a guide at
    rest. It may be none at a speed so far from that of the belt that no calibration errs by it.
    """
    slips = measures.regime is Regime.PURE_SLIP
    doubtful = slips and _may_rest_where_it_turns(window)
    if fit is not None:
        doubtful |= slips and fit.overtakes
        if fit.stick is not None:
            part = window if len(window.samples) or window.before is None else window.before
            belt = abs(float(part.samples.belt[-1]))
            doubtful |= abs(fit.stick.fit.belt_speed - belt) > _OTHER_SPEED * belt
    return undecided(measures) if doubtful else measures


def _not_surer(refined: Measures, segmented: StickSlip) -> Measures:
    """Return measures that are not surer than their distance from those of the rests.

    A distance of many errors shows that the friction has none of the forms of the fit. For an
    amplitude both errors count; for a stick fraction only that of the fit, as the least error of an
    edge would hide the distance.
    """
    errors = dict(refined.errors or {})
    for name, error in (("amplitude", segmented.errors.amplitude), ("stick_fraction", 0.0)):
        value = getattr(refined, name)
        if value is not None and name in errors:
            apart = abs(value - getattr(segmented.cycle, name))
            if apart > _APART * hypot(errors[name], error):
                errors[name] = apart / 2.0
    return replace(refined, errors=errors or None)


def rests_and_slips(window: Window, reading: SampleAssumptions) -> StickSlip | None:
    """Return the rests and slips that go on at the end of the run; None without them."""
    if not _may_segment(window, reading):
        return None
    return _lasting(window, float(window.samples.belt[-1]))


def _may_segment(window: Window, reading: SampleAssumptions) -> bool:
    """Return whether rests can be looked for: of enough samples, relative to one velocity."""
    samples = window.samples
    return len(samples) >= FEWEST_SAMPLES and not reading.stick_speed and _even(samples.belt)


def _lasting(window: Window, velocity: float) -> StickSlip | None:
    """Return rests at a velocity, m/s, and slips, that go on at the end of the run."""
    samples = window.samples
    found = stick_slip(samples.time, samples.position, velocity, window.most_cycles, window.step)
    if found is None:
        return None
    since = float(samples.time[-1]) - found.end
    return found if since <= STALE_PERIODS * found.cycle.period else None


def _may_rest_where_it_turns(window: Window) -> bool:
    """Return whether a slide on a guide at rest may rest where it turns.

    The number of samples near an extreme grows with the root of the distance, unless it rests.
    Where many samples are near one, noise or steps hide a rest.
    """
    samples, near, far = window.samples, 0, 0
    if samples.belt.any():
        return False
    distance = max(_NEAR_STEPS * window.step, REVERSAL * window.noise)
    ends = [samples.row(low.time) for low in window.lows]
    for first, last in pairwise(ends):
        for course in (samples.position[first:last], -samples.position[first:last]):
            below = course.max(initial=-inf) - course
            near += int(np.count_nonzero(below <= distance))
            far += int(np.count_nonzero(below <= 4.0 * distance))
    dwells = near > _LEAST_DWELL * 2 * (len(ends) - 1) > 0
    hidden = len(ends) > 1 and near > _MOST_NEAR * (ends[-1] - ends[0])
    return (dwells and far < _DWELL_GROWTH * near) or hidden


def segmented_measures(window: Window, segmented: StickSlip) -> Measures:
    """Return the measures of rests and slips, undecided where the rests are not sure."""
    measures = segmented.measures(False, *_trend(window, segmented.amplitudes))
    return measures if segmented.rests else undecided(measures)


def other_guide(window: Window, reading: SampleAssumptions) -> tuple[float, float] | None:
    """Return the velocity relative to which a slide rests that does not rest on its belt.

    Also the share of the time in which it does. None where there is no other one.
    """
    if not _may_segment(window, reading):
        return None
    on_belt, samples = rests_and_slips(window, reading), window.samples
    if on_belt is not None and on_belt.rests:
        return None
    velocity = resting_velocity(samples.time, samples.position)
    on_guide = _lasting(window, velocity)
    share = 0.0 if on_guide is None or not on_guide.rests else on_guide.cycle.stick_fraction
    return (velocity, share) if share > _REST_SHARE else None


def line(window: Window, reading: SampleAssumptions) -> float | None:
    """Return the frequency of the line in the spectrum of the last positions, in 1/samples."""
    position = _recent(window, reading).position
    # An encoder that rounds a steady motion has lines, too.
    if len(position) < FEWEST_SAMPLES:
        return None
    flat = position - np.linspace(position[0], position[-1], len(position))
    least = max(_resolved(window, reading), PRECISION * float(np.abs(position).max()))
    return strongest_line(flat) if np.ptp(flat) > least else None


def _even(belt: FloatArray) -> bool:
    """Return whether a belt keeps its speed."""
    return float(np.ptp(belt)) <= 1e-6 * abs(float(belt[-1]))


def _recent(window: Window, reading: SampleAssumptions) -> NoisySamples:
    """Return the samples of the last part of the run, of several cycles if there are any."""
    samples, cycles = window.samples, window.cycles
    row = len(samples) - min(max(window.run // 4, _SHORTEST), _LONGEST)
    if cycles and 2.0 * cycles[-1].amplitude > _resolved(window, reading):
        # What seems to be a last cycle may have ended by noise, long after.
        period = min(cycle.period for cycle in cycles)
        row = min(row, samples.row(float(samples.time[-1]) - LEAST_CYCLES * period))
    return samples[max(row, 0) :]


def _resolved(window: Window, reading: SampleAssumptions) -> float:
    """Return the range of positions, m, within which sensor or actuator resolve no motion."""
    return max(resolved(window.step, window.noise), reading.within)


def _by_reversals(
    window: Window, reading: SampleAssumptions, *, quick: bool
) -> tuple[Measures, MeanCycle | None]:
    part, resting, recent = window, window.resting, _recent(window, reading)
    # Few samples after a gap tell less than the cycles before it.
    enough = len(recent) >= (1 if window.before is None else FEWEST_SAMPLES)
    least = _resolved(window, reading)
    if enough and 0.0 < least >= float(np.ptp(recent.position)):
        if not recent.belt.any() and _may_move_on(window.samples.position, least):
            return without_cycles(None, None), None
        return rest(recent, window, reading, Regime.HELD), None
    if len(part.cycles) < LEAST_CYCLES and window.before is not None and not resting:
        part = window.before
    frequency = line(window, reading)
    resting |= not part.cycles
    if frequency is not None and (resting or frequency * FEW_SAMPLES > 1.0):
        return _by_line(window, reading, recent, frequency)
    if resting:
        # The second half of what has come since the last cycle.
        samples = part.samples
        first = samples.row(part.lows[-1].time) if part.cycles else 0
        return rest(samples[(first + len(samples)) // 2 :], window, reading), None
    starts = [low.time for low in part.lows]
    fit = None if quick else _fit(window, reading, part.samples, starts)
    # Half of the cycles: a single one may seem to stick for a moment.
    means = fit or CycleMeans.over(part.cycles, 0.5)
    if _are_ripples(part.samples, means):
        return without_cycles(None, None), None
    if fit is not None:
        return _found(window, part.samples, fit, fit.noise), fit
    measures = _found(window, part.samples, means, window.noise)
    fastest = max(cycle.velocity_amplitude for cycle in part.cycles)
    if (
        measures.errors
        and "stick_fraction" in measures.errors
        and fastest > STICKING_SHARE * float(np.abs(part.samples.belt).max())
    ):
        error = hypot(measures.errors["stick_fraction"], LEAST_STICK)
        measures = replace(measures, errors={**measures.errors, "stick_fraction": error})
    if measures.stick_fraction and measures.cycles < LEAST_CYCLES:  # nobody knows how much it errs
        measures = replace(measures, stick_fraction=None)
    periods = [cycle.period for cycle in part.cycles]
    most = _UNLIKE * len(periods) ** 0.5 if measures.stick_fraction else _UNLIKE_SLIPS
    unlike = np.std(periods) > most * np.mean(periods)
    return undecided(measures) if unlike else measures, None


def _may_move_on(position: FloatArray, least: float) -> bool:
    """Return whether a slide stands no longer than between its moves by more than `least`, m."""
    changes = np.flatnonzero(moves(position, least))[1:]  # the first is the start
    return len(changes) > 1 and len(position) - changes[-1] <= _STAND * np.diff(changes).max()


def _are_ripples(samples: NoisySamples, means: CycleMeans) -> bool:
    """Return whether the last cycles are ripples, as of 50 Hz, on a larger motion to and fro.

    Their middles vary, and those of all samples differ from the line through these.
    """
    count, amplitude = len(means.amplitudes), means.cycle.amplitude
    since = float(samples.time[-1]) - count * means.cycle.period
    rows = (len(samples) - samples.row(since)) // max(count, 1)
    if count < LEAST_CYCLES or rows == 0:
        return False
    middle = samples.position[len(samples) % rows :].reshape(-1, rows).mean(axis=1)
    last = middle[-count:]
    line = (last[-1] - last[0]) / (count - 1) * np.arange(len(middle))
    return min(float(np.ptp(last)), float(np.ptp(middle - line))) > _RIPPLE * amplitude


def _by_line(
    window: Window, reading: SampleAssumptions, samples: NoisySamples, frequency: float
) -> tuple[Measures, MeanCycle | None]:
    """Return the measures of the cycles that a line of the spectrum shows."""
    fit = None
    if frequency * LEAST_SAMPLES <= 1.0:
        time = samples.time
        period = float(time[-1] - time[0]) / (len(time) - 1) / frequency
        cycles = min(int(float(time[-1] - time[0]) / period), window.most_cycles)
        starts = (time[-1] - period * np.arange(cycles, -1.0, -1.0)).tolist()
        fit = _fit(window, reading, samples, starts)
    if fit is None:
        few = frequency * FEW_SAMPLES > 1.0
        return without_cycles(None, Regime.UNDERSAMPLED if few else None), None
    if _are_ripples(window.samples, fit):
        return without_cycles(None, None), None
    return _found(window, samples, fit, fit.noise), fit


def _fit(
    window: Window, reading: SampleAssumptions, samples: NoisySamples, starts: Sequence[float]
) -> MeanCycle | None:
    if len(starts) <= LEAST_CYCLES:
        return None
    part = samples[samples.row(starts[0]) : samples.row(starts[-1])]
    if not _even(part.belt):
        return None
    belt, known = float(part.belt[-1]), (window.noise, window.step, reading.stick_speed or 0.0)
    with np.errstate(over="ignore", invalid="ignore"):  # squares of very large positions
        return fit_mean_cycle(part.time, part.position, belt, np.array(starts), *known)


def _found(window: Window, samples: NoisySamples, means: CycleMeans, noise: float) -> Measures:
    """Return the measures of cycles in samples with this noise, m."""
    if noise < window.step / 2.0 and means.cycle.amplitude < _FEW_STEPS * window.step:
        means = replace(means, errors=None)
    fastest = float(np.abs(samples.belt).max())
    moving = float(samples.belt[-1]) != 0.0
    resting = moving and means.cycle.velocity_amplitude < EQUILIBRIUM_SPEED * fastest
    return means.measures(resting, *_trend(window, means.amplitudes))


def _trend(window: Window, amplitudes: FloatArray) -> tuple[bool | None, Trend | None]:
    """Return whether a window of cycles is steady, and the change of their amplitude.

    The line of least squares through the amplitudes shows growth and decay, their range a change to
    and fro; half of what is never to be called steady counts, as the estimate has noise, too.
    """
    if len(amplitudes) < LEAST_CYCLES:
        return None, None
    mean = float(np.mean(amplitudes))
    least = max(STEADY_CHANGE_UNDER_NOISE * mean, _QUANTUM * window.noise, window.step)
    order = np.linspace(-0.5, 0.5, len(amplitudes))
    change = float(order @ (amplitudes - mean) / (order @ order))
    if abs(change) > least / 2.0:
        return False, Trend.GROWING if change > 0.0 else Trend.DECAYING
    varies = float(np.ptp(amplitudes)) > 0.8 * least
    return not varies, Trend.VARYING if varies else None


def rest(
    samples: NoisySamples,
    window: Window,
    reading: SampleAssumptions,
    regime: Regime = Regime.EQUILIBRIUM,
) -> Measures:
    """Return the measures of a motion without cycles, steady once it lasts for as many as it had.

    The amplitude is that of a sine whose variance is what that of the positions exceeds the noise
    by. A slide that moves on, by a line through the positions, by more than is resolved, or to and
    fro from sample to sample, has no regime.
    """
    none = without_cycles(None, None)
    if len(samples) < 8:
        return none
    time = samples.time - samples.time[0]
    belt_speed = abs(float(samples.belt[-1]))
    slope = float(np.polyfit(time, samples.position - samples.position[0], 1)[0])
    spread = float(np.std(samples.position))
    far = max(_resolved(window, reading), REVERSAL * window.noise)
    far = max(far, PRECISION * abs(samples.position[0]))
    if abs(slope) > _SLIP_SHARE * belt_speed and abs(slope) * float(time[-1]) > far:
        return none
    amplitude = sqrt(2.0 * max(spread**2 - window.noise**2, 0.0))
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
    needed = window.most_cycles * window.cycles[-1].period if window.cycles else 0.0
    steady = float(time[-1]) * 2.0 >= needed or regime is Regime.HELD or None
    measures = without_cycles(at_rest, regime, steady=steady)
    return replace(measures, velocity_amplitude=None)  # the positions do not tell it
