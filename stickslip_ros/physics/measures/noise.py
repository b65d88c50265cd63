"""Noise of a record, found from the record itself."""

from math import comb

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray

_ORDERS = (6, 8, 10, 12, 14)
"""Orders of the differences that suppress the motion and leave the noise."""
_AGREEING = 1.4
"""Ratio of the noise by one order to that by the next, up to which both have found noise."""
_NORMAL_MEDIAN = 0.6745
"""Median magnitude of a normal variable of deviation 1."""
_IMPULSE = 10.0
"""Size of an impulse, in standard deviations of the noise."""
FEWEST = 32
"""Number of samples from which the noise is estimated."""


def white_noise(signal: FloatArray) -> float:
    """Return the standard deviation of the white noise of a signal sampled at equal steps.

    High differences suppress a smooth motion: at 60 samples per cycle the sixth leaves a millionth
    of it. Their median is robust against stick edges and impulses. Where no three successive
    orders agree, the differences are of the motion itself, and the noise counts as zero.

    Parameters
    ----------
    signal : array, shape (n,)
        Signal in any unit.

    Returns
    -------
    float
        Standard deviation in the unit of the signal; 0 for a signal without noise or with fewer
        than 32 samples.
    """
    if len(signal) < FEWEST:
        return 0.0
    # The n-th differences of white noise of deviation 1 have the variance (2n)! / n!^2.
    deviations = [
        float(np.median(np.abs(np.diff(signal, order)))) / (comb(2 * order, order) ** 0.5)
        for order in _ORDERS
    ]
    for low, middle, high in zip(deviations, deviations[1:], deviations[2:], strict=False):
        if _agree(low, middle) and _agree(middle, high):
            return middle / _NORMAL_MEDIAN
    return 0.0


def _agree(lower: float, higher: float) -> bool:
    return lower / _AGREEING < higher < _AGREEING * lower


def impulses(signal: FloatArray, noise: float) -> BoolArray:
    """Return which samples are impulses: single samples far from both of their neighbours.

    Parameters
    ----------
    signal : array, shape (n,)
        Signal in any unit.
    noise : float
        Standard deviation of its noise.

    Returns
    -------
    array of bool, shape (n,)
        True for each impulse; the first two and last two samples never are.
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
