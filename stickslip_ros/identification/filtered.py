"""Records that are filtered, all columns alike: position, velocity, acceleration, and force."""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.identification.record import Record, late
from stickslip_ros.identification.rests import rests

_CUTOFF = 100.0
"""Cutoff frequency of the low-pass, Hz; at most a tenth of the sample rate."""
_ORDER, _PAD = 4, 12
_DECIMATION, _ROW_RATE = 10, 100.0
"""Of a record that is decimated one of at least so many rows is kept; rows per second at most."""
START, END = 49, 50
"""Samples at both ends that the filter spoils."""
_REVERSAL_SAMPLES = 3
"""Samples on both sides of a reversal within which a slide that rests may stick unseen."""
_REACH, _TAPER = 0.5, 1.0
"""Times beside a rest, in periods of the cutoff: that which is left out, and that over which the
weight rises from there."""
_LEAST_WEIGHT = 0.5
"""Weight of the samples of a row from which on it is used."""


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
    weight: FloatArray | None
    """Weight of each sample in decimated rows, 0 where the slide rests; None: it never does."""
    path: float | None
    """Path behind a reversal that is left out, m; None: only near rests."""
    slipping: BoolArray
    """Whether the slide clearly slips, in one direction, for half of the length of the filter on
    both sides: such rows are to start a search."""
    settled: BoolArray
    """The same for twice its length: the filter has forgotten where the slide stuck."""

    def rows(self, values: FloatArray) -> FloatArray:
        """Return the rows of the regression that columns of shape (samples, ...) give."""
        if not self.decimated:
            return values[self.slipping]
        if self.weight is None:
            return self._decimated(values)
        # Samples are the last axis of the transpose.
        decimated = self._decimated((values.T * self.weight).T)
        used = self._row_weight > _LEAST_WEIGHT
        return (decimated[used].T / self._row_weight[used]).T

    @property
    def decimation(self) -> int:
        """Number of samples of a decimated row."""
        return max(round(1.0 / _ROW_RATE / float(self.time[1] - self.time[0])), _DECIMATION)

    @cached_property
    def _row_weight(self) -> FloatArray:
        assert self.weight is not None
        return self._decimated(self.weight)

    def _decimated(self, values: FloatArray) -> FloatArray:
        from scipy.signal import sosfiltfilt  # takes long to import

        low_pass = _chebyshev(self.decimation)
        smooth: FloatArray = np.asarray(sosfiltfilt(low_pass, values, axis=0))
        return smooth[:: self.decimation]


@cache
def _chebyshev(decimation: int) -> FloatArray:
    """Return the low-pass of rows of so many samples, in second-order sections."""
    from scipy.signal import cheby1  # takes long to import

    return np.asarray(cheby1(8, 0.05, 0.8 / decimation, output="sos"))


def filtered(
    record: Record, *, decimated: bool, delay: float | None = None, path: float | None = None
) -> Filtered:
    """Return the filtered columns of a record, without both ends.

    Rows are decimated for motions whose friction changes slowly. `delay` is the time from a sample
    until its force acts, s; by default the force at a sample is the one that answers it. With a
    path, m, rows near all reversals are left out, and those until the slide has gone as far; by
    default only those near rests.
    """
    from scipy.signal import butter, filtfilt  # takes long to import

    rate = 1.0 / record.period
    cutoff = min(_CUTOFF, 0.1 * rate)
    low_pass: Any = butter(_ORDER, cutoff / (0.5 * rate))

    def smooth(values: FloatArray) -> FloatArray:
        return np.asarray(filtfilt(low_pass[0], low_pass[1], values, padlen=_PAD))

    position = smooth(record.position)
    velocity: FloatArray = np.asarray(np.gradient(position, record.period))
    # The force that acts from one sample to the next changes the second difference exactly.
    acceleration = np.zeros_like(position)
    acceleration[1:-1] = np.diff(position, 2) / record.period**2
    # The velocity is meant over the same time.
    velocity[1:-1] -= np.diff(velocity, 2) / 12.0
    relative = velocity - smooth(record.belt_velocity)
    width = rate / cutoff
    weight = _moving_weight(record, relative, acceleration, width, path) if decimated else None
    if weight is not None:
        # The low-pass would carry the jump where the slide stops into the rows beside it; that of
        # the rows is enough for noise.
        acceleration[1:-1] = np.diff(record.position, 2) / record.period**2
    force = record.held_force if delay is None else mean_forces(record, delay)
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
        weight,
        path,
        _slipping(relative[inside], 0.5 * rate / cutoff),
        _slipping(relative[inside], 2.0 * rate / cutoff),
    )


def mean_forces(record: Record, delay: float) -> FloatArray:
    """Return the known forces, of which one is late, s, as they are on average around a sample."""
    force, disturbance = record.held_forces
    return late(force, 0.5 + delay / record.period) + late(disturbance, 0.5)


def _slipping(relative: FloatArray, reach: float) -> BoolArray:
    """Return where the speed stays away from zero for a number of samples on both sides."""
    from scipy.ndimage import minimum_filter1d

    width = 2 * max(round(reach), 1) + 1
    least = 0.02 * float(np.abs(relative).max())
    sides = [minimum_filter1d(sign * relative, width) > least for sign in (1.0, -1.0)]
    return sides[0] | sides[1]


def _moving_weight(
    record: Record, relative: FloatArray, acceleration: FloatArray, width: float, path: float | None
) -> FloatArray | None:
    """Return the weight of each sample in rows that tell of slip; None if all do.

    While it rests, friction is what the other forces ask for, and tells nothing of the law. The
    weight is zero there, near reversals, where it may stick between samples, up to a path, m,
    behind them, along which bristles deflect, and at both ends. Without a path it is None if the
    slide never rests. `width` is the period of the cutoff in samples.
    """
    from scipy.ndimage import maximum_filter1d

    left_out = np.zeros(len(relative), bool)
    for low, high in rests(record, relative):
        left_out[low:high] = True
    if path is None and not left_out.any():
        return None
    place = record.period * np.cumsum(np.abs(relative))
    turned = np.diff(np.sign(relative), prepend=0.0) != 0.0
    left_out |= place - np.maximum.accumulate(np.where(turned, place, 0.0)) < (path or 0.0)
    reversing = _REVERSAL_SAMPLES * record.period * np.abs(acceleration)
    left_out |= np.abs(relative) < reversing
    left_out[:START] = left_out[-END:] = True
    taper = np.hanning(round(_TAPER * width) + 2)
    reach = round((_REACH + 0.5 * _TAPER) * width)
    away: FloatArray = 1.0 - maximum_filter1d(left_out.astype(float), 2 * reach + 1)
    weight: FloatArray = np.convolve(away, taper / np.sum(taper), "same")
    return weight[START:-END]
