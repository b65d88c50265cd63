"""The noise of a signal: its deviation, the step of an encoder, impulses, and lines above it."""

from importlib import import_module
from math import comb, sqrt

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray

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
PRECISION, ROUNDING = 1e-12, 1e-8
"""Noise below this share of the largest values is rounding of the numbers, not of a sensor; below
this one, that of numbers in tables, as of a difference of columns with nine digits."""
NOISE_SHARE = 1e-7
"""Noise below this share of the motion is rounding, or an imperfection of the estimate."""
NOISE_SAMPLES = 4096
"""Number of samples from which the noise of a whole record is estimated."""
_STEP_DEVIATION = 1e-3
"""Largest deviation of whole numbers of steps."""
_DIVISIONS = 3
"""Number of divisions in which a step is found."""
NOISE_RANGE = 6.0
"""Range of the noise, in standard deviations."""


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


def import_for_noise() -> None:
    """Import the parts of SciPy that measures of samples with noise import when they need them."""
    for name in ("scipy.ndimage", "scipy.optimize"):
        import_module(name)


def encoder_step(signal: FloatArray, rounding: float = 0.0) -> float:
    """Return the step that all values of a signal are whole multiples of apart; 0 without one.

    It is the smallest distance of two levels, or of two such distances, if the others are multiples
    of it within a thousandth of a step (Euclid's algorithm). Values that differ by less than a
    share of the largest, the `rounding`, are of one level.
    """
    largest = float(np.abs(signal).max(initial=0.0))
    levels = np.diff(np.unique(signal))
    levels = levels[levels > rounding * largest]
    for _ in range(_DIVISIONS):
        if len(levels) == 0 or levels.min() <= max(rounding, PRECISION) * largest:
            return 0.0
        step = float(levels.min())
        rest = np.abs(levels - np.rint(levels / step) * step)
        if rest.max() < _STEP_DEVIATION * step:
            return step
        # What moves on evenly passes several steps from sample to sample: 13 or 14, say.
        levels = np.append(levels, rest[rest >= _STEP_DEVIATION * step])
    return 0.0


def resolved(step: float, noise: float = 0.0) -> float:
    """Return the range of positions, m, within which a sensor with this step and noise tells none.

    Rounding to the step is noise, too.
    """
    return step + NOISE_RANGE * max(noise, step / sqrt(12.0)) if step else 0.0


def unresolved(position: FloatArray) -> float:
    """Return the range, m, within which positions tell no motion, by their own step and noise."""
    step, noise = encoder_step(position), white_noise(position[-NOISE_SAMPLES:])
    if max(step, noise) <= NOISE_SHARE * float(np.ptp(position)):
        return 0.0
    return resolved(step, noise) or NOISE_RANGE * noise


def medians(signal: FloatArray) -> FloatArray:
    """Return the median of each value and those beside it; the first and the last as they are.

    Running medians of three take out single impulses and keep edges (J. W. Tukey, Exploratory Data
    Analysis, 1977, chapter 7).
    """
    before, here, after = signal[:-2], signal[1:-1], signal[2:]
    low, high = np.minimum(before, here), np.maximum(before, here)
    middle = np.maximum(low, np.minimum(high, after))
    return np.concatenate([signal[:1], middle, signal[1:][-1:]])


def rises(signal: FloatArray, band: float) -> IntArray:
    """Return the rows at which a signal rises above a band about zero from below it.

    Within the band, from minus to plus `band`, it may go to and fro: a Schmitt trigger (O. H.
    Schmitt, A thermionic trigger, Journal of Scientific Instruments 15, 1938).
    """
    outside = np.flatnonzero(np.abs(signal) > band)
    return outside[1:][(signal[outside[1:]] > 0.0) & (signal[outside[:-1]] < 0.0)]


def impulses(signal: FloatArray, noise: float) -> BoolArray:
    """Return which samples are impulses: single samples far from both of their neighbours.

    The second differences beside an impulse have the other sign and are half as large, unlike those
    of a motion. `noise` is the standard deviation. The first two and the last two samples never are
    impulses.
    """
    is_impulse = np.zeros(len(signal), np.bool_)
    if len(signal) < 5:
        return is_impulse
    bend = signal[1:-1] - (signal[:-2] + signal[2:]) / 2.0
    size = np.abs(bend)
    is_large = size[1:-1] > _IMPULSE * noise
    if not is_large.any():
        return is_impulse
    here, before, after = bend[1:-1], bend[:-2], bend[2:]
    alternates = (here * before < 0.0) & (here * after < 0.0)
    alternates &= np.minimum(size[:-2], size[2:]) > 0.25 * size[1:-1]
    # Next to an impulse the bends alternate, too, and are half as large.
    alternates &= size[1:-1] > np.maximum(size[:-2], size[2:])
    is_impulse[2:-2] = alternates & is_large
    return is_impulse


def strongest_line(signal: FloatArray) -> float | None:
    """Return the cycles per sample of the motion that the spectrum of 32 samples or more shows.

    It is the mean frequency, weighted by power, of the largest line in the periodogram of the
    signal without its trend, under the window sin^4 (F. J. Harris, On the use of windows for
    harmonic analysis with the discrete Fourier transform, Proceedings of the IEEE 66(1), 1978).
    None where no line has a fifth of the power and stands out from the median of the spectrum.
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
    count = len(signal)
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 4
    scale = max(float(np.abs(signal).max()), 1e-300)
    row = np.arange(count) - (count - 1) / 2.0
    level = signal / scale - float(np.mean(signal / scale))
    rest = level - float(row @ level) / float(row @ row) * row
    power: FloatArray = np.abs(np.fft.rfft(rest * window)) ** 2
    return power * scale**2 / float(window @ window)
