"""Positions with noise, as functions of samples: the noise, reversals, single cycles, rests."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb, pi, sqrt
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, Table
from stickslip_ros.physics.measures.cycle_measures import (
    STEADY_CHANGE_UNDER_NOISE,
    Cycle,
    Measures,
    Regime,
    Trend,
    without_cycles,
)

_ORDERS = (6, 8, 10, 12, 14)
"""Orders of the differences that suppress the motion and leave the noise."""
_LARGEST_RATIO = 1.4
"""Ratio of the noise by one order to that by the next, up to which both have found noise."""
_NORMAL_MEDIAN = 0.6745
"""Median magnitude of a normal variable of deviation 1."""
_IMPULSE = 10.0
"""Size of an impulse, in standard deviations of the noise."""
_LINE_HALF_WIDTH = 3
"""Half of the width of a line in the spectrum, in frequencies."""
_LINE_SHARE, _LINE_MEDIANS = 0.2, 30.0
"""Least power of a line, as a share of all and in medians."""
FEW_SAMPLES, LEAST_SAMPLES = 10.0, 4.0
"""Samples per cycle below which cycles are measured together only, and not at all."""
FEWEST_SAMPLES = 32
"""Number of samples from which the noise is estimated."""
PRECISION = 1e-12
"""Noise below this share of the largest values is rounding of the numbers, not of a sensor."""
REVERSAL = 8.0
"""Least size of a reversal, in standard deviations of the noise."""
_PASSING_SHARE = 1.15
"""Share of the belt speed beyond which a slide has passed the belt; calibrations err by less."""
_LEAST_STICK = 0.03
"""Stick fraction up to which a single cycle counts as one without a stick."""
_QUANTUM = 1.73
"""Resolution of an encoder with a noise of half of it, in standard deviations of the two."""
_SLIP_SHARE = 0.1
"""Share of the belt speed by which a slide at rest may seem to move."""


def white_noise(signal: FloatArray) -> float:
    """Return the standard deviation of the white noise of a signal sampled at equal steps.

    High differences suppress a smooth motion (Hall, Kay and Titterington, Biometrika 1990): at 60
    samples per cycle the sixth leaves a millionth of it. Their median is robust against stick edges
    and impulses. Where no three successive orders agree, or the spectrum is one of lines, the
    differences are of the motion itself, and the noise counts as zero; so it does below 32 samples.
    """
    if len(signal) < FEWEST_SAMPLES:
        return 0.0
    # The n-th differences of white noise of deviation 1 have the variance (2n)! / n!^2.
    deviations = [
        float(np.median(np.abs(np.diff(signal, order)))) / (comb(2 * order, order) ** 0.5)
        for order in _ORDERS
    ]
    for low, middle, high in zip(deviations, deviations[1:], deviations[2:], strict=False):
        if _agree(low, middle) and _agree(middle, high):
            noise = middle / _NORMAL_MEDIAN
            line = strongest_line(signal)
            if line is None or line * FEW_SAMPLES < 1.0:
                return noise
            if line * LEAST_SAMPLES > 1.0:
                return 0.0
            # Noise is between the lines, too; motion with few samples per cycle is not.
            return min(noise, float(np.median(_spectrum(signal)) / np.log(2.0)) ** 0.5)
    return 0.0


def _agree(lower: float, higher: float) -> bool:
    return lower / _LARGEST_RATIO < higher < _LARGEST_RATIO * lower


def impulses(signal: FloatArray, noise: float) -> BoolArray:
    """Return which samples are impulses: single samples far from both of their neighbours.

    The second differences beside an impulse have the other sign and are half as large, unlike those
    of a motion. `noise` is the standard deviation. The first two and the last two samples never are
    impulses.
    """
    found = np.zeros(len(signal), np.bool_)
    if len(signal) < 5:
        return found
    bend = signal[1:-1] - (signal[:-2] + signal[2:]) / 2.0
    here, before, after = bend[1:-1], bend[:-2], bend[2:]
    size = np.abs(here)
    alternates = (here * before < 0.0) & (here * after < 0.0)
    alternates &= np.minimum(np.abs(before), np.abs(after)) > 0.25 * size
    found[2:-2] = alternates & (size > _IMPULSE * noise)
    # Next to an impulse the bends alternate, too, and are half as large.
    larger = np.maximum(np.abs(before), np.abs(after))
    found[2:-2] &= size > larger
    return found


def strongest_line(signal: FloatArray) -> float | None:
    """Return the cycles per sample of the motion that the spectrum of 32 samples or more shows.

    None where no line has a fifth of the power and stands out from noise.
    """
    power = _spectrum(signal)
    at = int(np.argmax(power))
    around = slice(max(at - _LINE_HALF_WIDTH, 0), at + _LINE_HALF_WIDTH + 1)
    stands_out = power[at] > _LINE_MEDIANS * float(np.median(power))
    if at <= _LINE_HALF_WIDTH or not stands_out or power[around].sum() < _LINE_SHARE * power.sum():
        return None
    bins = np.arange(len(power))[around]
    return float(bins @ power[around] / power[around].sum()) / len(signal)


def _spectrum(signal: FloatArray) -> FloatArray:
    """Return the power of a signal without its trend, for frequencies from 0 to a half."""
    from scipy.signal import detrend  # takes long to import

    count = len(signal)
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 4
    scale = max(float(np.abs(signal).max()), 1e-300)
    power: FloatArray = np.abs(np.fft.rfft(detrend(signal / scale) * window)) ** 2
    return power * scale**2 / float(window @ window)


@dataclass
class NoisySamples(Table):
    """Columns of samples without impulses; SI units."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt: FloatArray
    median: FloatArray
    """Median of each position and those beside it, m."""

    def row(self, time: float) -> int:
        """Return the first row that is not earlier than a time, s."""
        return int(np.searchsorted(self.time, time))


class Point(NamedTuple):
    """A position at an instant."""

    time: float
    position: float


class Extremes:
    """Highest and lowest points of a signal, fed sample by sample.

    A reversal is a way back from the last extreme by more than `least`; what goes back by less is
    noise. So one pass finds what `scipy.signal.find_peaks` finds by prominence, in a stream.
    """

    def __init__(self) -> None:
        self.last: Point | None = None
        """The highest or lowest point since the last reversal."""
        self._rising: bool | None = None

    def feed(self, samples: Sequence[Point], least: float) -> list[tuple[Point, bool]]:
        """Return the extremes that these samples conclude, and whether each is a highest point."""
        found: list[tuple[Point, bool]] = []
        for sample in samples:
            if self.last is None:
                self.last = sample
            change = sample.position - self.last.position
            if self._rising is None:
                if abs(change) > least:
                    self.last, self._rising = sample, change > 0.0
            elif change != 0.0 and self._rising == (change > 0.0):
                self.last = sample
            elif abs(change) > least:
                found.append((self.last, self._rising))
                self.last, self._rising = sample, not self._rising
        return found


def fit_reach(samples: NoisySamples, low: float, high: float | None, noise: float) -> int:
    """Return the number of samples on each side of an extreme to which a parabola is fitted.

    The times are those of a lowest and of a highest point. The reach grows with the fifth root of
    the noise, where the curve's departure from a parabola and the noise err alike.
    """
    if high is None or high == low:
        return 2
    at_low, at_high = samples.row(low), samples.row(high)
    size = abs(float(samples.position[at_high] - samples.position[at_low]))
    share = np.clip(1.2 * (2.0 * noise / size) ** 0.2, 0.1, 0.6) if size > 0.0 else 0.1
    return max(int(share * abs(at_high - at_low) / pi), 2)


def vertex(samples: NoisySamples, at: int, reach: int) -> Point:
    """Return the highest or lowest point near a row, of the parabola through `reach` beside it."""
    rows = slice(max(at - reach, 0), at + reach + 1)
    time, position = samples.time[rows], samples.position[rows]
    centre, scale = float(samples.time[at]), float(time[-1] - time[0])
    sample = Point(centre, float(samples.position[at]))
    if len(time) < 5 or scale <= 0.0:
        return sample
    u = (time - centre) / scale
    base = float(position[0])
    bend, slope, level = np.polyfit(u, position - base, 2)
    if bend == 0.0:
        return sample
    at_vertex = float(np.clip(-slope / (2.0 * bend), u[0], u[-1]))
    height = float(level + at_vertex * (slope + at_vertex * bend))
    return Point(centre + at_vertex * scale, base + height)


def cycle_between(
    samples: NoisySamples, start: Point, end: Point, high: float, noise: float
) -> Cycle | None:
    """Return the cycle between two lowest points, with its highest sample at the time `high`.

    Displacements are those of the fitted extremes; velocities, and the stick by them, are slopes of
    parabolas through as many samples. None without a period.
    """
    period = end.time - start.time
    if period <= 0.0:
        return None
    first, last = samples.row(start.time), samples.row(end.time)
    lowest = (start.position + end.position) / 2.0
    reach = fit_reach(samples, start.time, high, noise)
    highest = vertex(samples, samples.row(high), reach).position
    around = samples[max(first - reach, 0) : last + reach]
    slowest, fastest, stick_time = _velocities(around, reach, noise)
    return Cycle(
        amplitude=(highest - lowest) / 2.0,
        velocity_amplitude=(fastest - slowest) / 2.0,
        midpoint=(highest + lowest) / 2.0,
        period=period,
        frequency=1.0 / period,
        stick_fraction=stick_time / period if stick_time > _LEAST_STICK * period else 0.0,
    )


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


def _velocities(samples: NoisySamples, reach: int, noise: float) -> tuple[float, float, float]:
    """Return lowest and highest velocity, m/s, of one cycle, and its stick time, s."""
    time, position = samples.time, samples.position
    if len(time) < 2 * reach + 3:
        if len(time) == 0:
            return 0.0, 0.0, 0.0
        return float(samples.velocity.min()), float(samples.velocity.max()), 0.0
    # The slope of the parabola through the samples within reach.
    lags = np.arange(-reach, reach + 1)
    step = float(time[-1] - time[0]) / (len(time) - 1)
    slopes = np.convolve(position, -lags / (lags @ lags), "valid") / step
    at = time[reach : len(time) - reach]
    belt = float(np.median(samples.belt))
    sign = -1.0 if belt < 0.0 else 1.0
    error = noise / (step * sqrt(lags @ lags))
    stick_time = _stick_time(at, sign * slopes, abs(belt), error)
    return float(slopes.min()), float(slopes.max()), stick_time


def _stick_time(time: FloatArray, velocity: FloatArray, belt_speed: float, error: float) -> float:
    """Return for how long the velocity is that of the belt, s, from crossings below it.

    The relative speed is linear in time before the landing and quadratic after the departure: the
    edges follow from the crossings of two thresholds each. `error` is the standard error of the
    velocities.
    """
    margin = max(0.1 * belt_speed, 4.0 * error)
    if 4.0 * margin >= belt_speed + abs(float(velocity.min())):
        return 0.0
    # A slide that passes the belt and moves on does not stick.
    riding = np.flatnonzero(np.abs(velocity - belt_speed) < margin)
    highest = float(velocity.max())
    near = belt_speed - margin / 2.0 <= highest <= _PASSING_SHARE * belt_speed + 2.0 * error
    if not near or len(riding) == 0:
        return 0.0
    first, last = int(riding[0]), int(riding[-1])

    def before(threshold: float) -> float | None:
        rows = np.flatnonzero(velocity[:first] < threshold)
        return None if len(rows) == 0 else _crossing(time, velocity, int(rows[-1]), threshold)

    def after(threshold: float) -> float | None:
        rows = np.flatnonzero(velocity[last + 1 :] < threshold)
        return None if len(rows) == 0 else _crossing(time, velocity, last + int(rows[0]), threshold)

    landed, landing = before(belt_speed - margin), before(belt_speed - 2.0 * margin)
    departing, departed = after(belt_speed - margin), after(belt_speed - 4.0 * margin)
    if landed is None or landing is None or departing is None or departed is None:
        return 0.0
    return max((2.0 * departing - departed) - (2.0 * landed - landing), 0.0)


def _crossing(time: FloatArray, velocity: FloatArray, row: int, threshold: float) -> float:
    """Return when the velocity crosses a threshold between a row and the next."""
    before, after = velocity[row], velocity[row + 1]
    share = (threshold - before) / (after - before) if after != before else 0.0
    return float(time[row] + share * (time[row + 1] - time[row]))
