"""Drift: a trend of a run that looks steady from cycle to cycle and would not be later."""

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray

_PARTS = 128
"""Least number of parts of a long run; the trend is that over the last quarter of them."""
_LEAST_PARTS = 8
"""Number of parts from which a trend is looked for."""
_LEAST_ERRORS = 3.0
"""Trend, in standard errors, above which it is one."""
_LEAST_CHANGE = 0.01
"""Change over one more run, as a share of the largest magnitude, above which it matters."""


_Values = Sequence[float] | npt.NDArray[Any]


class TrendMeter:
    """Means of a quantity over equal parts of a run, in constant memory.

    The parts overlap with weights that rise and fall like a triangle: where a part has a whole
    number of cycles of a vibration, but for a little, plain means would have a slow beat.
    """

    def __init__(self) -> None:
        self._sums: FloatArray
        """Weight, and weighted time and value, of each part; made with the first of them."""
        self._count, self._each, self._largest = 0, 1, 0.0
        self._waiting: list[tuple[_Values, _Values]] = []
        """Times and values that are not yet in the sums: added together they take less time."""
        self._waiting_count = 0

    def feed(self, time: _Values, value: _Values) -> None:
        """Add the times, s, and values that follow, in blocks of any length; they are kept."""
        if len(time) > 0:
            self._waiting.append((time, value))
            self._waiting_count += len(time)
        if self._waiting_count >= _PARTS:
            self._add_waiting()

    def _add_waiting(self) -> None:
        time, value = np.concatenate([np.empty((2, 0)), *map(np.array, self._waiting)], axis=1)
        self._waiting, self._waiting_count = [], 0
        new = np.array([np.ones(len(time)), time, value]).T[np.isfinite(value)]
        self._largest = max(self._largest, float(np.abs(new[:, 2]).max(initial=0.0)))
        if self._count == 0:
            self._sums = np.zeros((2 * _PARTS + 1, 3))
        while len(new) > 0:
            fits = 2 * _PARTS * self._each - self._count
            part, new = new[:fits], new[fits:]
            place = (self._count + np.arange(len(part))) / self._each
            rows = np.repeat(place.astype(np.int64), 2)
            weights = np.repeat(place, 2) - rows
            weights[::2] = 1.0 - place + rows[::2]
            rows[1::2] += 1
            with np.errstate(over="ignore", invalid="ignore"):
                for sums, values in zip(self._sums.T, part.T, strict=True):  # quicker than at once
                    np.add.at(sums, rows, weights * np.repeat(values, 2))
            self._count += len(part)
            if self._count == 2 * _PARTS * self._each:
                odd = self._sums[1::2] / 2.0
                self._sums[: _PARTS + 1] = self._sums[::2]
                self._sums[:_PARTS] += odd
                self._sums[1 : _PARTS + 1] += odd
                self._sums[_PARTS + 1 :] = 0.0
                self._each *= 2

    def rate(self, span: float = 0.0, least: float = 0.0) -> float | None:
        """Return the rate of change, 1/s, if it is certain and matters; else None.

        The trend is that over the last quarter of the run, and at least over `span` (s), or over
        the last half, if that of the quarter agrees. It matters if one more such run would change
        the quantity by a hundredth, and by more than `least`, the step of a sensor: half the sum or
        difference of two positions has an error of at least its rounding.
        """
        if self._count + self._waiting_count < _LEAST_PARTS:
            return None
        self._add_waiting()
        weight, *sums = self._sums.T
        with np.errstate(invalid="ignore"):
            every, values = np.array(sums)[:, weight == self._each] / self._each
        run = float(every[-1] - every[0]) if len(every) else 0.0
        lines: list[tuple[FloatArray, FloatArray]] = []
        for length in (max(run / 4.0, span), run / 2.0):
            rows = every >= every[-1:] - length
            if length <= run and np.count_nonzero(rows) >= _LEAST_PARTS:
                lines.append((every[rows] - every[rows].mean(), values[rows]))
        matters = max(_LEAST_CHANGE * self._largest, least)
        last: tuple[float, float] | None = None
        with np.errstate(over="ignore", invalid="ignore"):
            if all(abs(time @ value) * run <= matters * (time @ time) for time, value in lines):
                return None
            for time, value in lines:
                slope, error = fit_line(time, value, least / sqrt(24.0))
                if last is not None and abs(slope - last[0]) > 2.0 * last[1]:
                    break
                if abs(slope) * run > matters and abs(slope) > _LEAST_ERRORS * error:
                    return slope
                last = slope, error
        return None


def fit_line(time: FloatArray, value: FloatArray, noise: float = 0.0) -> tuple[float, float]:
    """Return the slope of a line and its standard error; the mean of the times is zero.

    Each value has at least the standard deviation `noise`: few may agree by chance. Residuals that
    follow each other count as one, by their first autocorrelation: fewer by (1 - r) / (1 + r)
    (Bayley and Hammersley, 1946).
    """
    square = float(time @ time)
    mean, slope = float(value.mean()), float(time @ value) / square
    residual = value - mean - slope * time
    freedom = max(len(time) - 2, 1)
    total = max(float(residual @ residual), freedom * noise**2)
    if total == 0.0:
        return slope, 0.0
    variance, follow = total / freedom, float(residual[1:] @ residual[:-1]) / total
    share = min(max(follow, 0.0), 0.999)
    return slope, (variance / square * (1.0 + share) / (1.0 - share)) ** 0.5


class Drift:
    """Trends of the position, the amplitude and the control force of a run."""

    resolution = 0.0
    """Step of the sensor, m: a smaller change of position does not matter."""
    rounding = 0.0
    """Displacement, m, that is rounding."""
    judged = True
    """Whether a trend is a drift; not where a time profile or a reference varies."""

    def __init__(self) -> None:
        self.position, self.force = TrendMeter(), TrendMeter()
        self._midpoint, self._amplitude = TrendMeter(), TrendMeter()

    def feed_cycles(self, ends: Sequence[float], cycles: Sequence[Any]) -> None:
        """Add the cycles that follow, and the times (s) at which they end."""
        self._midpoint.feed(ends, [cycle.midpoint for cycle in cycles])
        self._amplitude.feed(ends, [cycle.amplitude for cycle in cycles])

    def rates(self, period: float | None) -> dict[str, float]:
        """Return the rate of each quantity that drifts, 1/s, given the period of cycles (s)."""
        if not self.judged:
            return {}
        span = _LEAST_PARTS / 2 * (period or 0.0)
        # Parts of cycles have other means than whole ones.
        position = self._midpoint if period else self.position
        least = max(self.resolution, self.rounding)
        rates = {
            "position": position.rate(span, least),
            "amplitude": self._amplitude.rate(span, least) if period else None,
            "force": self.force.rate(span),
        }
        return {name: rate for name, rate in rates.items() if rate is not None}
