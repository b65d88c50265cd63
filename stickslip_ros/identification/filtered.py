"""Records filtered for regression: position, velocity, acceleration and force, all alike."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.identification.record import Record

_CUTOFF = 100.0
"""Cutoff frequency of the low-pass, Hz; at most a tenth of the sample rate."""
_ORDER, _PAD = 4, 12
DECIMATION = 10
"""Every so many rows one is kept of a record that is decimated."""
START, END = 49, 50
"""Samples at both ends that the filter spoils."""


@dataclass(frozen=True, eq=False)
class Filtered:
    """The filtered columns of a record, arrays of shape (samples,); SI units.

    A. Janot, M. Gautier, M. Brunot, Data set and reference models of EMPS, 2019: a Butterworth
    low-pass of order 4 forwards and backwards, then central differences. For slow motions every
    column of the equation is decimated by ten behind a Chebyshev low-pass.
    """

    time: FloatArray
    """Time from the first sample, s."""
    position: FloatArray
    """Displacement, m."""
    velocity: FloatArray
    """Velocity, m/s."""
    acceleration: FloatArray
    """Acceleration, m/s^2."""
    relative_speed: FloatArray
    """Velocity less that of the belt, m/s."""
    force: FloatArray
    """Known forces, N."""
    decimated: bool
    """Whether rows are decimated; otherwise they are those where the slide clearly slips."""
    slipping: BoolArray
    """Whether the slide clearly slips, in one direction, for half of the length of the filter on
    both sides: such rows are to start a search."""
    settled: BoolArray
    """The same for twice its length: the filter has forgotten where the slide stuck."""

    def rows(self, values: FloatArray) -> FloatArray:
        """Return the rows of the regression that columns of shape (samples, ...) give."""
        if not self.decimated:
            return values[self.slipping]
        from scipy.signal import cheby1, sosfiltfilt  # takes long to import

        chebyshev = cheby1(8, 0.05, 0.8 / DECIMATION, output="sos")
        return sosfiltfilt(chebyshev, values, axis=0)[::DECIMATION]

    def with_delay(self, record: Record, delay: float) -> "Filtered":
        """Return the columns, decimated, of the same record with another delay of its force, s."""
        return replace(self, force=_shifted(record.held_force, delay / record.period)[START:-END])


def filtered(record: Record, *, decimated: bool, delay: float | None = None) -> Filtered:
    """Return the filtered columns of a record, without both ends.

    Rows are decimated for motions whose friction changes slowly. `delay` is the time from a sample
    until its force acts, s; by default the force at a sample is the one that answers it.
    """
    from scipy.signal import butter, filtfilt  # takes long to import

    rate = 1.0 / record.period
    cutoff = min(_CUTOFF, 0.1 * rate)
    low_pass: Any = butter(_ORDER, cutoff / (0.5 * rate))

    def smooth(values: FloatArray) -> FloatArray:
        return np.asarray(filtfilt(low_pass[0], low_pass[1], values, padlen=_PAD))

    position = smooth(record.position)
    velocity: FloatArray = np.asarray(np.gradient(position, record.period))
    acceleration: FloatArray = np.asarray(np.gradient(velocity, record.period))
    relative = velocity - smooth(record.belt_velocity)
    held = record.held_force
    force = held if delay is None else _shifted(held, delay / record.period)
    if not decimated:
        force = smooth(force)  # all that enters the equation passes the same filter
    time: FloatArray = record.period * np.arange(len(position), dtype=float)
    inside = slice(START, -END)
    return Filtered(
        time[inside],
        position[inside],
        velocity[inside],
        acceleration[inside],
        relative[inside],
        force[inside],
        decimated,
        _slipping(relative[inside], 0.5 * rate / cutoff),
        _slipping(relative[inside], 2.0 * rate / cutoff),
    )


def _shifted(held: FloatArray, periods: float) -> FloatArray:
    """Return forces, held from sample to sample, as they are on average around each sample."""
    at = np.arange(len(held)) - periods
    edges = np.concatenate([[0.0], np.cumsum(held)])
    places = np.arange(len(edges))
    return np.interp(at + 0.5, places, edges) - np.interp(at - 0.5, places, edges)


def _slipping(relative: FloatArray, reach: float) -> BoolArray:
    """Return where the speed stays away from zero for a number of samples on both sides."""
    from scipy.ndimage import minimum_filter1d

    width = 2 * max(round(reach), 1) + 1
    least = 0.02 * float(np.abs(relative).max())
    sides = [minimum_filter1d(sign * relative, width) > least for sign in (1.0, -1.0)]
    return sides[0] | sides[1]
