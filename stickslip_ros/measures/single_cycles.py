"""Single cycles of positions with noise: reversals, and what is measured between them."""

from dataclasses import dataclass
from math import isnan, nan
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray, Table, median
from stickslip_ros.measures.cycle_measures import STICKING_SHARE, Cycle
from stickslip_ros.measures.noise import medians
from stickslip_ros.measures.parabolas import slopes, vertex
from stickslip_ros.measures.rests import (
    CREEP,
    PASSING,
    REST_SHARE,
    SHORTEST_MEAN,
    SURE,
    Rest,
    creep_in,
    farthest,
    joined,
    least_slip,
    mean_length,
    rests_among,
)
from stickslip_ros.measures.slip_edges import edge

_CYCLE_CREEP_ERROR = 0.06
"""Largest standard error of the speed in the rest of a single cycle, in mean speeds, with which it
is known."""
_CYCLE_PASSING = 0.1
"""Speed in what looks like the rest of a single cycle, in mean speeds, from which it moves."""
_TURNING = 0.1
"""Share of a single cycle on a guide at rest up to which it may be slow only where it turns."""
_COARSE = 0.05
"""Length of a mean, in cycles, from which a single cycle does not show whether, and how long, it
rests, unless the mean is one of the fewest samples."""
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
        return int(self.time.searchsorted(time))


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
        rows.append(rows[-1] + int(rest[: back.argmax()].argmax()))
        course = -course


def reach_beside(low: int, high: int) -> int:
    """Return the number of rows on each side of an extreme in a parabola; `low` to `high` apart."""
    return max(abs(high - low) // 10, 2)


def extreme_near(samples: NoisySamples, at: int, reach: int) -> Point:
    """Return the highest or lowest point near a row.

    It is the vertex of the parabola through the samples up to `reach` rows beside it. Where there
    are too few samples, or no bend, it is the sample.
    """
    reach = min(reach, at, len(samples) - 1 - at)
    if reach < 2:
        return Point(float(samples.time[at]), float(samples.position[at]))
    rows = slice(at - reach, at + reach + 1)
    lag, position = vertex(samples.position[rows])
    time = float(np.interp(lag, np.arange(-reach, reach + 1), samples.time[rows]))
    return Point(time, position)


def cycle_between(
    samples: NoisySamples, start: Point, end: Point, high: int, noise: float, step: float
) -> Cycle | None:
    """Return the cycle between two lowest points, with its highest sample at the row `high`.

    Displacements are those of the fitted extremes, velocities slopes of parabolas through as many
    samples, and the stick is the rest from the landing to the release; NaN where the positions do
    not tell it. `noise` and `step` are those of the positions, m. None without a period.
    """
    period = end.time - start.time
    if period <= 0.0:
        return None
    first, last = samples.row(start.time), samples.row(end.time)
    lowest = (start.position + end.position) / 2.0
    reach = reach_beside(first, high)
    highest = extreme_near(samples, high, reach).position
    around = samples[max(first - reach, 0) : last + reach]
    reach = max(min(reach, (len(around) - 3) // 2), 1)
    rate = (len(around) - 1) / float(around.time[-1] - around.time[0])
    velocity = rate * slopes(around.position, reach)
    part = samples[max((3 * first - last) // 2, 0) : last + reach_beside(last, high) + 1]
    belt, times = median(part.belt), (start.time, end.time)
    stick = _stick_share(part.time, part.position, belt, times, noise, step)
    if isnan(stick) and np.abs(velocity).max() < STICKING_SHARE * abs(belt):
        stick = 0.0
    return Cycle(
        amplitude=(highest - lowest) / 2.0,
        velocity_amplitude=float(np.ptp(velocity)) / 2.0,
        midpoint=(highest + lowest) / 2.0,
        period=period,
        frequency=1.0 / period,
        stick_fraction=0.0 if stick <= LEAST_STICK else stick,
    )


def _stick_share(
    time: FloatArray,
    position: FloatArray,
    belt_velocity: float,
    cycle: tuple[float, float],
    noise: float,
    step: float,
) -> float:
    """Return the share of a single cycle, from its start to its end, s, in which a slide rests.

    Positions, m, at times, s, begin before the cycle and end after it, on a belt with this
    velocity, m/s. `noise` and `step` are those of the sensor, m. NaN where they do not tell it.
    """
    start, end = cycle
    period, relative = end - start, position - belt_velocity * (time - time[0])
    size = abs(belt_velocity) * period or 2.0 * float(np.ptp(position))
    travel = size / period * float(time[-1] - time[0]) / (len(time) - 1)
    reach = mean_length(travel, noise, step)
    coarse = reach * travel > _COARSE * size
    if travel <= 0.0 or len(time) < 2 * reach + 2 or (coarse and reach > SHORTEST_MEAN):
        return nan
    least = least_slip(size, noise, step)
    rests = joined(relative, rests_among(relative, reach, REST_SHARE * travel * reach), least)
    ends = [Rest(row, row, float(relative[row])) for row in (0, len(time) - 1)]
    around = [ends[0], *(rest for rest in rests if time[rest.last] > start), ends[1]]
    still: list[tuple[float, float]] = []
    for before, rest, after in zip(around, around[1:], around[2:], strict=False):
        edges = [start, end]
        for side, other in enumerate((before, after)):
            if abs(other.level - rest.level) <= least:  # it comes back, or does not leave
                other = farthest(relative, rest, other)
            if abs(other.level - rest.level) > least:
                edges[side] = edge(time, relative, rest, other, noise, step)[0]
        still.append((max(edges[0], start), min(edges[1], end)))
    stick_time = sum(max(release - landing, 0.0) for landing, release in still)
    if stick_time == 0.0:
        return nan if coarse else 0.0
    creep, error = np.array(creep_in(time, relative, still, noise, step)) * period / size
    if abs(creep) > max(_CYCLE_PASSING, PASSING * error):
        return 0.0
    known = abs(creep) <= max(CREEP, SURE * error) and error <= _CYCLE_CREEP_ERROR
    known &= belt_velocity != 0.0 or stick_time > _TURNING * period
    return stick_time / period if known and stick_time < period else nan
