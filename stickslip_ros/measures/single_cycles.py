"""Single cycles of positions with noise: reversals, and what is measured between them.

Extremes and velocities are those of parabolas through the samples beside them, by least squares
(A. Savitzky and M. J. E. Golay, Analytical Chemistry 36, 1964).
"""

from dataclasses import dataclass
from functools import lru_cache
from math import copysign, isfinite, nan, sqrt
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray, Table
from stickslip_ros.measures.cycle_measures import Cycle
from stickslip_ros.measures.noise import medians

_PASSING_SHARE = 1.15
"""Share of the belt speed beyond which a slide has passed the belt; calibrations err by less."""
LEAST_STICK = 0.03
"""Stick fraction up to which a single cycle counts as one without a stick: it errs by as much."""


@dataclass
class NoisySamples(Table):
    """Columns of samples without impulses; SI units."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt: FloatArray

    def row(self, time: float) -> int:
        """Return the first row that is not earlier than a time, s."""
        return int(np.searchsorted(self.time, time))


class Point(NamedTuple):
    """A position at an instant."""

    time: float
    position: float


def reversals(position: FloatArray, least: float) -> list[tuple[int, int]]:
    """Return the rows of each highest position and of the lowest after it, by their way back.

    An extreme is one from which the positions go back by more than `least`; what goes back by less
    is noise. They are the peaks with this prominence of `scipy.signal.find_peaks`, of medians over
    three positions, in which impulses do not count; the start counts as a lowest position, and the
    last position only for the median beside it.
    """
    course, rows = medians(position)[:-1], [0]
    while True:
        rest = course[rows[-1] :]
        back = np.maximum.accumulate(rest) - rest > least
        if not back.any():
            return list(zip(rows[1::2], rows[2::2], strict=False))
        rows.append(rows[-1] + int(np.argmax(rest[: int(np.argmax(back))])))
        course = -course


@lru_cache(64)
def _least_squares(reach: int) -> FloatArray:
    """Return the rows that give value, slope and half of the bend at the middle of a parabola."""
    lags = np.arange(-reach, reach + 1.0)
    return np.linalg.pinv(np.vander(lags, 3, increasing=True)).astype(float)


def parabolas(course: FloatArray, reach: int) -> list[FloatArray]:
    """Return value, slope and half of the second derivative, in rows, of a parabola at each row.

    It is that of least squares through the rows up to `reach` beside it.
    """
    part = np.pad(course - course[0], reach, mode="edge")
    value, slope, bend = (np.convolve(part, row[::-1], "valid") for row in _least_squares(reach))
    return [value + course[0], slope, bend]


def reach_beside(low: int, high: int) -> int:
    """Return the number of rows on each side of an extreme in a parabola; `low` to `high` apart."""
    return max(abs(high - low) // 10, 2)


def vertex(samples: NoisySamples, at: int, reach: int) -> Point:
    """Return the highest or lowest point near a row.

    It is the vertex of the parabola through the samples up to `reach` rows beside it. Where there
    are too few samples, or no bend, it is the sample.
    """
    reach = min(reach, at, len(samples) - 1 - at)
    if reach < 2:
        return Point(float(samples.time[at]), float(samples.position[at]))
    rows = slice(at - reach, at + reach + 1)
    base = float(samples.position[at])
    value, slope, bend = (_least_squares(reach) @ (samples.position[rows] - base)).tolist()
    lag = float(np.clip(-slope / (2.0 * bend), -reach, reach)) if bend else 0.0
    time = float(np.interp(lag, np.arange(-reach, reach + 1), samples.time[rows]))
    return Point(time, base + value + lag * (slope + lag * bend))


def cycle_between(
    samples: NoisySamples, start: Point, end: Point, high: int, noise: float
) -> Cycle | None:
    """Return the cycle between two lowest points, with its highest sample at the row `high`.

    Displacements are those of the fitted extremes; velocities, and the stick by them, are slopes of
    parabolas through as many samples. None without a period.
    """
    period = end.time - start.time
    if period <= 0.0:
        return None
    first, last = samples.row(start.time), samples.row(end.time)
    lowest = (start.position + end.position) / 2.0
    reach = reach_beside(first, high)
    highest = vertex(samples, high, reach).position
    around = samples[max(first - reach, 0) : last + reach]
    reach = max(min(reach, (len(around) - 3) // 2), 1)
    inner = slice(reach, len(around) - reach)
    step = float(around.time[-1] - around.time[0]) / (len(around) - 1)
    kernel = _least_squares(reach)[1, ::-1]
    slopes = np.convolve(around.position, kernel, "valid") / step
    belt = float(np.median(around.belt))
    error = noise / (step * sqrt(reach * (reach + 1) * (2 * reach + 1) / 3.0))
    direction = copysign(1.0, belt)
    stick_time = _stick_time(around.time[inner], direction * slopes, abs(belt), error)
    return Cycle(
        amplitude=(highest - lowest) / 2.0,
        velocity_amplitude=float(np.ptp(slopes)) / 2.0,
        midpoint=(highest + lowest) / 2.0,
        period=period,
        frequency=1.0 / period,
        stick_fraction=stick_time / period if stick_time > LEAST_STICK * period else 0.0,
    )


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
    before = time[: first + 1], velocity[: first + 1]
    after = time[last:][::-1], velocity[last:][::-1]
    landed, landing, departing, departed = (
        _rise(*part, belt_speed - margins * margin)
        for part, margins in ((before, 1.0), (before, 2.0), (after, 1.0), (after, 4.0))
    )
    stick_time = (2.0 * departing - departed) - (2.0 * landed - landing)
    return max(stick_time, 0.0) if isfinite(stick_time) else 0.0


def _rise(time: FloatArray, velocity: FloatArray, threshold: float) -> float:
    """Return when the velocity last rises through a threshold; NaN where it does not."""
    rows = np.flatnonzero(velocity[:-1] < threshold)
    if len(rows) == 0:
        return nan
    pair = slice(int(rows[-1]), int(rows[-1]) + 2)
    return float(np.interp(threshold, velocity[pair], time[pair]))
