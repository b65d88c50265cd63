"""Rests: where positions stand, relative to a guide.

A slide rests where two means beside each other differ by less than half of what it travels on
average in their distance (the Haar wavelet: S. Mallat and W. L. Hwang, Singularity detection and
processing with wavelets, IEEE Transactions on Information Theory 38, 1992). The means are so long
that step and noise of the sensor do not hide this travel.
"""

from collections.abc import Sequence
from math import ceil, hypot, inf, sqrt
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.measures.noise import NOISE_RANGE, NOISE_SAMPLES, encoder_step, white_noise

REST_SHARE = 0.5
"""Speed up to which a slide may rest, and error of the speed in rests up to which they may be some,
in mean speeds."""
SURE = 3.0
"""Standard errors by which a difference is no error."""
CREEP = 0.03
"""Speed in the rests, in mean speeds, up to which they are rests if it is within its error."""
PASSING = 4.0
"""Speed in the rests, in its standard errors, from which the slide passes."""
_FEWEST_REACHES = 16
"""Number of samples, in lengths of a mean, from which rests are looked for."""
SHORTEST_MEAN, _MOST = 2, 1e9
"""Least and largest number of positions in a mean."""
_STEPS = 1.3
"""Least travel between two means, in steps of the encoder."""
_DEVIATIONS = 3.5
"""Least change of the travel between two means that is no rest, in its standard deviations."""
_LEAST_STEPS = 3.5
"""Travel between two rests that is a slip, in steps of the encoder, at least."""
_LEAST_NOISES = 5.0
"""Travel between two rests that is a slip, in standard deviations of the noise, at least."""
_LEAST_SHARE = 0.1
"""Travel between two rests that is a slip, in large slips, at least."""
_BLOCKS = 4096
"""Number of means of positions from which the mean speed is taken."""
_CORE = 0.15
"""Share of a rest at its edges that does not count for its speed."""
_SHORTH = 0.2
"""Share of the velocities that are alike while a slide rests."""
_NEGLIGIBLE = 0.05
"""Velocity of a rest, in mean speeds, that is none."""


class Rest(NamedTuple):
    """A rest: its first and last rows, and where it is, m."""

    first: int
    last: int
    level: float


def rests_apart(position: FloatArray, travel: float, noise: float, step: float) -> list[Rest]:
    """Return the rests between slips; `travel` is the mean between two samples, m."""
    reach = mean_length(travel, noise, step)
    if travel <= 0.0 or len(position) < _FEWEST_REACHES * reach:
        return []
    rests = rests_among(position, reach, REST_SHARE * travel * reach)
    if len(rests) < 2:
        return []
    large = large_size(np.abs(np.diff([rest.level for rest in rests])))
    return joined(position, rests, least_slip(large, noise, step))


def rests_among(position: FloatArray, reach: int, most: float) -> list[Rest]:
    """Return the rests among positions.

    The means over `reach` positions before and after a row of a rest differ by at most `most`.
    """
    still = np.abs(_changes(position, reach)) <= most * reach
    still = np.concatenate([[False], still, [False]])
    turns = np.flatnonzero(still[1:] != still[:-1]).tolist()
    apart: list[tuple[int, int]] = []
    for first, end in zip(turns[::2], turns[1::2], strict=True):
        last = end + 2 * reach - 2
        if apart and apart[-1][1] >= first:
            middle = (apart[-1][1] + first) // 2
            apart[-1] = apart[-1][0], middle
            first = middle + 1
        if last > first:
            apart.append((first, last))
    inner = [slice((3 * a + b) // 4, max((a + 3 * b) // 4, (3 * a + b) // 4 + 1)) for a, b in apart]
    levels = [float(position[rows].mean()) for rows in inner]
    return [Rest(*rows, level) for rows, level in zip(apart, levels, strict=True)]


def joined(position: FloatArray, rests: list[Rest], least: float) -> list[Rest]:
    """Return rests as one between which no slip of the `least` travel, m, leads away.

    Between its slips a slide creeps, and seems to rest more than once.
    """
    if not rests:
        return []
    apart, longest = rests[:1], rests[0]
    for rest in rests[1:]:
        away = abs(farthest(position, longest, rest).level - longest.level)
        if max(away, abs(rest.level - longest.level)) > least:
            apart.append(rest)
            longest = rest
        else:
            longest = max(longest, rest, key=lambda rest: rest.last - rest.first)
            apart[-1] = Rest(apart[-1].first, rest.last, longest.level)
    return apart


def farthest(position: FloatArray, rest: Rest, other: Rest) -> Rest:
    """Return the row between two rests whose position is farthest from the first, as a rest."""
    begin, end = sorted((rest, other))
    rows = slice(begin.last, end.first + 1)
    row = begin.last + int(np.argmax(np.abs(position[rows] - rest.level)))
    return Rest(row, row, float(position[row]))


def least_slip(large: float, noise: float, step: float) -> float:
    """Return the least travel between two rests that is a slip, m; `large` is a usual one."""
    return max(_LEAST_STEPS * step, _LEAST_NOISES * noise, _LEAST_SHARE * large)


def large_size(sizes: FloatArray) -> float:
    """Return the mean of large sizes: from half of the one that a tenth exceeds."""
    return float(np.mean(sizes[sizes >= np.quantile(sizes, 0.9) / 2.0]))


def mean_length(travel: float, noise: float, step: float) -> int:
    """Return the number of positions in each of two means between which a slide rests or moves.

    `travel` is the mean distance between two samples, m.
    """
    if travel <= 0.0:
        return 0
    by_noise = (_DEVIATIONS * sqrt(2.0) * noise / (REST_SHARE * travel)) ** (2.0 / 3.0)
    return ceil(min(max(by_noise, _STEPS * step / travel, SHORTEST_MEAN), _MOST))


def _changes(position: FloatArray, reach: int) -> FloatArray:
    """Return the sum of each `reach` positions less that of as many before."""
    total = np.zeros(len(position) + 1)
    np.cumsum(position - position[0], out=total[1:])
    return total[2 * reach :] - 2.0 * total[reach:-reach] + total[: -2 * reach]


def mean_speed(time: FloatArray, position: FloatArray, noise: float, step: float) -> float:
    """Return the mean speed of what moves to and fro by more than step and noise, m/s."""
    block = max(len(position) // _BLOCKS, 1)
    course = position[: len(position) // block * block].reshape(-1, block).mean(axis=1)
    changes = np.flatnonzero(moves(course, max(step, NOISE_RANGE * noise)))
    return float(np.abs(np.diff(course[changes])).sum()) / float(time[-1] - time[0])


def moves(course: FloatArray, least: float) -> BoolArray:
    """Return where a course is by more than `least` away from where it last was that."""
    moved, held = [True], float(course[0])
    for position in course[1:].tolist():
        moved.append(abs(position - held) > least)
        if moved[-1]:
            held = position
    return np.array(moved)


def creep_in(
    time: FloatArray,
    position: FloatArray,
    rests: Sequence[tuple[float, float]],
    noise: float,
    step: float,
) -> tuple[float, float]:
    """Return the mean velocity in rests between two times, s, in m/s, and its standard error."""
    products = squares = lasting = 0.0
    for landing, release in rests:
        margin = _CORE * (release - landing)
        first, last = time.searchsorted((landing + margin, release - margin)).tolist()
        if last - first >= 2:
            part = time[first:last] - float(time[first:last].mean())
            products += float(part @ position[first:last])
            squares += float(part @ part)
            lasting += float(part[-1] - part[0])
    if squares <= 0.0 or lasting <= 0.0:
        return 0.0, inf
    return products / squares, hypot(noise / sqrt(squares), step / lasting)


def resting_velocity(time: FloatArray, position: FloatArray) -> float:
    """Return the velocity, m/s, that positions, m, at times, s, have for longest.

    One that is small against the mean speed is 0. It is the mean of the shortest interval with a
    fifth of the velocities, by the change of two means (the shorth: D. F. Andrews et al., Robust
    Estimates of Location, 1972).
    """
    last = position[-NOISE_SAMPLES:]
    noise, step = white_noise(last), encoder_step(last)
    speed = mean_speed(time, position, noise, step)
    period = float(time[-1] - time[0]) / (len(time) - 1)
    reach = mean_length(speed * period, noise, step)
    if speed == 0.0 or len(time) < _FEWEST_REACHES * reach:
        return 0.0
    change = np.sort(_changes(position, reach))
    count = int(len(change) * _SHORTH)
    first = int(np.argmin(change[count:] - change[: len(change) - count]))
    velocity = float(np.mean(change[first : first + count + 1])) / (reach**2 * period)
    return velocity if abs(velocity) > _NEGLIGIBLE * speed else 0.0
