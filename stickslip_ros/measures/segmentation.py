"""Rests and moves: the measures of a slide that rests and slips, from its positions.

Relative to the guide a slide rests or moves. It rests where two means beside each other differ by
less than half of what the slide travels on average in their distance (the Haar wavelet: S. Mallat
and W. L. Hwang, Singularity detection and processing with wavelets, IEEE Transactions on
Information Theory 38, 1992). The means are so long that step and noise of the sensor do not hide
this travel. Cycles are what repeats from release to release. At an edge the distance from the rest
grows with a power of time; the edge is where that power extrapolates to zero, and what the powers
that fit differ by is part of its error.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, hypot, inf, sqrt
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.measures.cycle_measures import Cycle, CycleMeans, Measures
from stickslip_ros.measures.noise import FEWEST_SAMPLES, ROUNDING, encoder_step, white_noise
from stickslip_ros.measures.single_cycles import parabolas

_TAIL, _GROWTH = 2048, 4
"""Number of last samples in which cycles are looked for first, and its growth while they are few.
"""
_BLOCKS = 4096
"""Number of means of positions from which the mean speed is taken."""
_LOOK = 4096
"""Number of last samples from which noise and step are estimated."""
_REST_SHARE = 0.5
"""Share of the mean speed up to which a slide may rest."""
_STEPS, _DEVIATIONS = 1.3, 3.5
"""Travel between two means, in steps of the encoder, and the change of them that is no rest, in
their standard deviations, at least."""
_MOST = 1e9
"""Largest number of positions in a mean."""
_SHORTH, _NEGLIGIBLE = 0.2, 0.05
"""Share of the velocities that are alike while a slide rests; speed, in mean speeds, that is none.
"""
_FEWEST_REACHES = 16
"""Number of samples, in lengths of a mean, from which rests are looked for."""
_LEAST_STEPS, _LEAST_NOISES, _LEAST_SHARE = 3.5, 5.0, 0.1
"""Travel between two rests, in steps, standard deviations and large slips, that is a slip."""
_MAIN_SHARE = 0.35
"""Travel of a slip, in large ones, from which it is a main slip, from which a cycle may begin."""
_CUT = 0.25
"""Part of a slip within which positions that begin after its release look like a rest."""
_LONG_GAP = 3.0
"""Time between two releases, in periods, after which cycles begin again."""
_FEWEST_CYCLES = 3
"""Number of cycles that repeat."""
_EDGE_STEPS, _EDGE_NOISES, _EDGE_FLOOR, _EDGE_SHARE, _EDGE_REACH = 0.6, 4.0, 1e-3, 0.25, 40.0
"""Distance from a rest, in steps, standard deviations and slips, that is none; share of a slip, and
number of such distances, to which its edges are fitted."""
_RELEASE_POWERS, _LANDING_POWERS = (2.0, 3.0, 4.0, 6.0), (1.5, 2.0, 2.5)
"""Powers of time with which the distance from a rest may grow: a friction that falls at once leaves
a constant force, one that falls with the speed lets the motion grow slowly."""
_EDGE_ERROR, _SLIP_ERROR = 0.3, 0.03
"""Least standard error of an edge, in sample periods and slip times."""
_CORE = 0.15
"""Share of a rest at its edges that does not count for its speed."""
_LEAST_CREEP, _CREEP, _CREEP_ERROR, _PASSING = 0.01, 0.03, 0.02, 4.0
"""Speed in the rests, in mean speeds, up to which they are rests, and up to which they are if it is
within its error; largest standard error of it; errors from which the slide passes."""
_SAME_PERIOD, _SURE = 0.01, 3.0
"""Relative difference of the periods, and of the stick fractions in standard errors, of the same
cycles."""
_LEAST_RIDE, _MOST_RIDE, _PASSES = 1e-3, 0.06, 3
"""Velocity in the rests, in belt speeds, that may be an error of that of the belt; passes in which
it is corrected."""
_NO_FEED = 0.02
"""Travel on, as a share of that to and fro, that is none."""
_SMOOTH_SHARES, _WIDEST = (0.05, 0.1), 40
"""Half of the width of the parabola for displacement and velocity, in slip times, and in samples at
most."""
_BETWEEN, _EXTREME_ERROR = 0.7, 0.15
"""What an extreme between two of the samples of a slip, and noise or a step, leave of an amplitude:
shares of the amplitude over the square of their number, and of the noise."""


@dataclass(frozen=True)
class StickSlip(CycleMeans):
    """Means over the last cycles of a slide that rests and slips."""

    errors: Cycle
    """Their standard errors, SI units, with those of the edges."""
    end: float
    """Release with which the last of these cycles ends, s."""
    feed: float
    """Mean velocity of the slide relative to the guide in these cycles, m/s."""
    creep: float
    """Velocity relative to the guide in the rests, in mean speeds."""
    creep_error: float
    """Its standard error."""
    slip_samples: float
    """Number of samples in a slip."""

    @property
    def rests(self) -> bool:
        """Whether the slide is known to rest."""
        most = min(max(_LEAST_CREEP, _SURE * self.creep_error), _CREEP)
        lasting = self.cycle.stick_fraction > _SURE * self.errors.stick_fraction
        return lasting and abs(self.creep) <= most and self.creep_error <= _CREEP_ERROR

    @property
    def passes(self) -> bool:
        """Whether the slide is known to move on in what looks like rests."""
        return abs(self.creep) > max(_CREEP, _PASSING * self.creep_error)

    @property
    def rides(self) -> bool:
        """Whether what looks like rests moves on slowly, as on a belt of another velocity."""
        slow = _LEAST_RIDE < abs(self.creep) < _MOST_RIDE
        return slow and abs(self.creep) > _SURE * self.creep_error

    def agrees(self, measures: Measures) -> bool:
        """Return whether measures that were found otherwise are those of the same cycles."""
        if measures.stick_fraction is None or not measures.period:
            return False
        share, error = self.cycle.stick_fraction, self.errors.stick_fraction
        error = hypot(error, (measures.errors or {}).get("stick_fraction", 0.0))
        same = abs(measures.period / self.cycle.period - 1.0) < _SAME_PERIOD
        return same and abs(measures.stick_fraction - share) < _SURE * error


class _Move(NamedTuple):
    """A move between two rests: their middle rows, the last row of the first, and levels, m."""

    first: int
    last: int
    begin: int
    levels: tuple[float, float]

    @property
    def travel(self) -> float:
        return self.levels[1] - self.levels[0]


class _Slip(NamedTuple):
    release: float
    landing: float
    errors: tuple[float, float]
    travel: float

    @property
    def duration(self) -> float:
        return self.landing - self.release


def stick_slip(
    time: FloatArray, position: FloatArray, belt_velocity: float, most_cycles: int, step: float
) -> StickSlip | None:
    """Return the measures of the last cycles of a slide that rests and slips; None without them.

    Positions, m, at times, s, are seen from where the belt, or the guide, has this velocity, m/s;
    without one, the mean velocity of the cycles is taken from them. `step` is that of the encoder,
    m, or 0: one that only shows relative to the guide is found.
    """
    count = _TAIL
    while True:
        part = slice(max(len(time) - count, 0), None)
        samples = time[part], position[part]
        cycles = _measured(*samples, belt_velocity, belt_velocity, most_cycles, step)
        guide = belt_velocity
        for _ in range(_PASSES):
            if cycles is None or not belt_velocity or not cycles.rides:
                break
            # The velocity of the belt, or the scale of the positions, is a little wrong.
            guide += cycles.creep * abs(belt_velocity)
            cycles = _measured(*samples, belt_velocity, guide, most_cycles, step)
        if count >= len(time) or (cycles is not None and len(cycles.amplitudes) >= most_cycles):
            return cycles
        count *= _GROWTH


def resting_velocity(time: FloatArray, position: FloatArray) -> float:
    """Return the velocity, m/s, that positions, m, at times, s, have for longest.

    One that is small against the mean speed is 0. It is the mean of the shortest interval with a
    fifth of the velocities, by the change of two means (the shorth: D. F. Andrews et al., Robust
    Estimates of Location, 1972).
    """
    noise = white_noise(position[-_LOOK:])
    step = encoder_step(position[-_LOOK:])
    speed = _mean_speed(time, position, max(step, 6.0 * noise))
    period = float(time[-1] - time[0]) / (len(time) - 1)
    reach = _reach(speed * period, noise, step)
    if speed == 0.0 or len(time) < _FEWEST_REACHES * reach:
        return 0.0
    change = np.sort(_changes(position, reach))
    count = int(len(change) * _SHORTH)
    first = int(np.argmin(change[count:] - change[: len(change) - count]))
    velocity = float(np.mean(change[first : first + count + 1])) / (reach**2 * period)
    return velocity if abs(velocity) > _NEGLIGIBLE * speed else 0.0


def _measured(
    time: FloatArray,
    position: FloatArray,
    belt_velocity: float,
    guide_velocity: float,
    most_cycles: int,
    step: float,
) -> StickSlip | None:
    goes_back = np.any(np.diff(time) < 0.0)
    if len(time) < FEWEST_SAMPLES or goes_back or not time[-1] > time[0]:
        return None
    relative = position - guide_velocity * (time - time[0])
    step = max(step, encoder_step(relative[-_LOOK:], ROUNDING))
    noise = white_noise(relative[-_LOOK:])
    speed = abs(belt_velocity) or _mean_speed(time, relative, max(step, 6.0 * noise))
    course = _moves_between_rests(time, relative, speed, noise, step)
    starts = _cycle_starts(time, course)[-most_cycles - 1 :]
    if not starts:
        return None
    near = max(_EDGE_STEPS * step, _EDGE_NOISES * noise)
    used = [_slip(time, relative, move, near) for move in course[starts[0] : starts[-1] + 1]]
    if used[0].release - float(time[0]) < _CUT * used[0].duration:  # they begin after it
        used, starts = used[starts[1] - starts[0] :], starts[1:]
    if len(starts) <= _FEWEST_CYCLES:
        return None
    release = np.array([used[start - starts[0]].release for start in starts])
    if not np.all(np.diff(release) > 0.0):
        return None  # times that repeat
    del used[-1]
    period = float(release[-1] - release[0]) / (len(release) - 1)
    durations = np.add.reduceat([slip.duration for slip in used], np.array(starts[:-1]) - starts[0])
    shares = 1.0 - durations / np.diff(release)
    feed = _advance(used) / float(release[-1] - release[0])
    if not belt_velocity:
        position = position - feed * (time - time[0])
    width = float(np.median([slip.duration for slip in used]))
    width = max(width * (len(time) - 1) / float(time[-1] - time[0]), 1.0)
    extremes = _extremes(time, position, np.searchsorted(time, release).tolist(), width)
    columns = [*extremes, np.diff(release), 1.0 / np.diff(release), shares]
    means = CycleMeans.over([Cycle(*measures) for measures in np.transpose(columns).tolist()])
    errors = _errors(means, used, width, max(step, noise))
    creep, creep_error = _creep(time, relative, used, noise, step)
    if creep_error == inf:
        return None
    unit = abs(belt_velocity) or speed
    return StickSlip(
        cycle=replace(
            means.cycle,
            frequency=1.0 / period,
            stick_fraction=1.0 - float(np.sum(durations)) / float(release[-1] - release[0]),
        ),
        errors=errors,
        sticks=True,
        amplitudes=means.amplitudes,
        end=float(release[-1]),
        feed=feed,
        creep=creep / unit,
        creep_error=creep_error / unit,
        slip_samples=width,
    )


def _advance(slips: list[_Slip]) -> float:
    """Return the travel of slips on the whole, m; 0 where they only go to and fro."""
    travel = np.array([slip.travel for slip in slips])
    advance = float(np.sum(travel))
    return advance if abs(advance) >= _NO_FEED * float(np.sum(np.abs(travel))) else 0.0


def _errors(means: CycleMeans, slips: list[_Slip], width: float, resolution: float) -> Cycle:
    """Return the standard errors of means, with those of the edges and the extremes.

    A slip has `width` rows, and the sensor a step or noise of `resolution`, m.
    """
    errors, cycle, count = means.errors, means.cycle, len(means.amplitudes)
    assert errors is not None  # of three cycles
    edges = np.mean([slip.errors for slip in slips], axis=0) * len(slips) / count / cycle.period
    extreme = hypot(_EXTREME_ERROR * resolution, _BETWEEN * cycle.amplitude / width**2)
    return replace(
        errors,
        amplitude=hypot(errors.amplitude, extreme),
        midpoint=hypot(errors.midpoint, extreme),
        stick_fraction=hypot(errors.stick_fraction, float(np.hypot(*edges))),
    )


def _mean_speed(time: FloatArray, position: FloatArray, least: float) -> float:
    """Return the mean speed of what moves by more than `least`, m, to and fro, m/s."""
    block = max(len(position) // _BLOCKS, 1)
    course = position[: len(position) // block * block].reshape(-1, block).mean(axis=1)
    changes = np.flatnonzero(moves(course, least))
    return float(np.abs(np.diff(course[changes])).sum()) / float(time[-1] - time[0])


def moves(course: FloatArray, least: float) -> BoolArray:
    """Return where a course is by more than `least` away from where it last was that."""
    moved, held = [True], float(course[0])
    for position in course[1:].tolist():
        moved.append(abs(position - held) > least)
        if moved[-1]:
            held = position
    return np.array(moved)


def _reach(travel: float, noise: float, step: float) -> int:
    """Return the number of positions in each of two means between which a slide rests or moves.

    `travel` is the mean distance between two samples, m.
    """
    if travel <= 0.0:
        return 0
    by_noise = (_DEVIATIONS * sqrt(2.0) * noise / (_REST_SHARE * travel)) ** (2.0 / 3.0)
    return ceil(min(max(by_noise, _STEPS * step / travel, 2.0), _MOST))


def _changes(position: FloatArray, reach: int) -> FloatArray:
    """Return the sum of each `reach` positions less that of as many before."""
    total = np.concatenate([[0.0], np.cumsum(position - position[0])])
    return total[2 * reach :] - 2.0 * total[reach:-reach] + total[: -2 * reach]


def _rests(position: FloatArray, reach: int, most: float) -> list[tuple[int, int]]:
    """Return the first and last rows of the rests among positions.

    The means over `reach` positions before and after a row of a rest differ by at most `most`.
    """
    still = np.abs(_changes(position, reach)) <= most * reach
    turns = np.flatnonzero(np.diff(still, prepend=False, append=False)).reshape(-1, 2)
    apart: list[tuple[int, int]] = []
    for first, last in (turns + np.array([0, 2 * reach - 2])).tolist():
        if apart and apart[-1][1] >= first:
            middle = (apart[-1][1] + first) // 2
            apart[-1] = apart[-1][0], middle
            first = middle + 1
        if last > first:
            apart.append((first, last))
    return apart


def _moves_between_rests(
    time: FloatArray, position: FloatArray, speed: float, noise: float, step: float
) -> list[_Move]:
    """Return the moves between two rests."""
    period = float(time[-1] - time[0]) / (len(time) - 1)
    travel = speed * period
    if travel <= 0.0:
        return []
    reach = _reach(travel, noise, step)
    if len(time) < _FEWEST_REACHES * reach:
        return []
    rests = _rests(position, reach, _REST_SHARE * travel * reach)
    if len(rests) < 2:
        return []
    inner = [slice((3 * a + b) // 4, max((a + 3 * b) // 4, (3 * a + b) // 4 + 1)) for a, b in rests]
    level = [float(np.mean(position[rest])) for rest in inner]
    jumps = np.abs(np.diff(level))
    large = float(np.mean(jumps[jumps >= np.quantile(jumps, 0.9) / 2.0]))
    least = max(_LEAST_STEPS * step, _LEAST_NOISES * noise, _LEAST_SHARE * large)
    # Between its slips a slide creeps, and seems to rest more than once.
    first, last, longest = [0], [0], [0]
    for number in range(1, len(rests)):
        if abs(level[number] - level[longest[-1]]) > least:
            for rows in (first, last, longest):
                rows.append(number)
        else:
            last[-1] = number
            if np.ptp(rests[number]) > np.ptp(rests[longest[-1]]):
                longest[-1] = number
    course: list[_Move] = []
    for before in range(len(first) - 1):
        rows = [rests[first[group]][0] + rests[last[group]][1] for group in (before, before + 1)]
        levels = level[longest[before]], level[longest[before + 1]]
        course.append(_Move(rows[0] // 2, rows[1] // 2, rests[last[before]][1], levels))
    return course


def _slip(time: FloatArray, position: FloatArray, move: _Move, near: float) -> _Slip:
    """Return the slip of a move, with its edges."""
    first, last, _, levels = move
    travel = move.travel
    size = abs(travel)
    course = (position[first : last + 1] - levels[0]) * (1.0 if travel > 0.0 else -1.0)
    middle = int(np.argmax(course > size / 2.0))
    near = max(near, _EDGE_FLOOR * size)
    start, start_error = _edge(course[: middle + 1], near, size, _RELEASE_POWERS)
    end, end_error = _edge(size - course[middle:][::-1], near, size, _LANDING_POWERS)
    rows = np.arange(last - first + 1)
    release, landing = np.interp([start, len(rows) - 1 - end], rows, time[first : last + 1])
    least = _SLIP_ERROR * float(landing - release)
    period = float(time[last] - time[first]) / max(last - first, 1)
    errors = hypot(start_error * period, least), hypot(end_error * period, least)
    return _Slip(float(release), float(landing), errors, travel)


def _edge(
    course: FloatArray, near: float, size: float, powers: tuple[float, ...]
) -> tuple[float, float]:
    """Return the row at which a course leaves zero on its way to a slip of this size; its error."""
    inside = np.flatnonzero(course <= near)
    last = int(inside[-1]) if len(inside) else 0
    far = near + min(_EDGE_SHARE * size, _EDGE_REACH * near)
    beyond = np.flatnonzero(course[last + 1 :] > far)
    end = last + 2 + int(beyond[0]) if len(beyond) else len(course)
    rows = np.arange(last + 1, min(end, len(course)))
    if len(rows) < 3:
        return last + 0.5, hypot(_EDGE_ERROR, 0.3)
    values, middle = np.maximum(course[rows], 0.0), (rows[0] + rows[-1]) / 2.0
    lag, exponents = rows - middle, np.array(powers)[:, np.newaxis]
    roots = values ** (1.0 / exponents)
    offset, slope = roots.mean(axis=1), roots @ lag / (lag @ lag)
    edges = np.full(len(powers), float(last))
    np.divide(-offset, slope, out=edges, where=slope > 0.0)
    edges[slope > 0.0] += middle
    fitted = np.maximum(offset[:, np.newaxis] + slope[:, np.newaxis] * lag, 0.0) ** exponents
    squares = np.sum((fitted - values) ** 2, axis=1) + (near / 3.0) ** 2
    edges = np.clip(edges, 0.0, last + 1.0)
    weight = (squares.min() / squares) ** 2
    weight /= weight.sum()
    mean = float(weight @ edges)
    return mean, hypot(_EDGE_ERROR, sqrt(float(weight @ (edges - mean) ** 2)))


def _cycle_starts(time: FloatArray, course: list[_Move]) -> list[int]:
    """Return the moves with which the last cycles begin, and the one with which they end.

    Where main moves to and fro take turns, two of them are a cycle.
    """
    if not course:
        return []
    travel = np.array([move.travel for move in course])
    sizes = np.abs(travel)
    large = float(np.mean(sizes[sizes >= np.quantile(sizes, 0.9) / 2.0]))
    main = np.flatnonzero(sizes >= _MAIN_SHARE * large)
    forward = travel[main] > 0.0
    turns = np.count_nonzero(forward[1:] != forward[:-1])
    if turns > len(main) // 2:
        main = main[forward]
        forward = forward[forward]
    release = time[[course[move].begin for move in main]]
    if len(main) <= _FEWEST_CYCLES:
        return []
    gaps = np.diff(release)
    breaks = (gaps > _LONG_GAP * np.median(gaps)) | (forward[1:] != forward[:-1])
    parts = np.split(main, np.flatnonzero(breaks) + 1)
    return next((part.tolist() for part in parts[::-1] if len(part) > _FEWEST_CYCLES), [])


def _extremes(time: FloatArray, position: FloatArray, rows: list[int], width: float) -> FloatArray:
    """Return amplitudes, velocity amplitudes and midpoints of the cycles from row to row.

    Of parabolas through the samples around each (Savitzky and Golay, Analytical Chemistry 36,
    1964): displacements are extreme at a vertex, within shares of the `width` of a slip, in rows.
    """
    narrow, wide = (max(int(min(share * width, _WIDEST)), 1) for share in _SMOOTH_SHARES)
    first, last = max(rows[0] - wide, 0), rows[-1] + wide + 1
    period = float(time[-1] - time[0]) / (len(time) - 1)
    part = position[first:last]
    smooth, slope, bend = parabolas(part, narrow)
    speed = parabolas(part, wide)[1] / period
    # At a corner, as of a flat top, the rows beside it do not bend so, and there is no vertex.
    bends = np.pad(np.abs(bend), 1, mode="edge")
    least = np.minimum(np.minimum(bends[:-2], bends[2:]), bends[1:-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        smooth -= np.where(np.abs(slope) < 2.0 * least, slope**2 / (4.0 * bend), 0.0)
    cycles = [slice(start - first, end - first + 1) for start, end in pairwise(rows)]
    high, low = (
        np.array([extreme(smooth[cycle]) for cycle in cycles]) for extreme in (np.max, np.min)
    )
    return np.array([high - low, [np.ptp(speed[cycle]) for cycle in cycles], high + low]) / 2.0


def _creep(
    time: FloatArray, position: FloatArray, slips: list[_Slip], noise: float, step: float
) -> tuple[float, float]:
    """Return the mean velocity in the rests between slips, m/s, and its standard error."""
    products = squares = lasting = 0.0
    for before, after in pairwise(slips):
        margin = _CORE * (after.release - before.landing)
        first, last = np.searchsorted(time, [before.landing + margin, after.release - margin])
        if last - first >= 2:
            part = time[first:last] - float(np.mean(time[first:last]))
            products += float(part @ position[first:last])
            squares += float(part @ part)
            lasting += float(part[-1] - part[0])
    if squares <= 0.0 or lasting <= 0.0:
        return 0.0, inf
    return products / squares, hypot(noise / sqrt(squares), step / lasting)
