"""Rests and moves: the measures of a slide that rests and slips, from its positions.

Relative to the guide a slide rests or moves. It rests where two means beside each other differ by
less than half of what the slide travels on average in their distance (the Haar wavelet: S. Mallat
and W. L. Hwang, Singularity detection and processing with wavelets, IEEE Transactions on
Information Theory 38, 1992). The means are so long that step and noise of the sensor do not hide
this travel. Cycles are what repeats from release to release, at the edges of the slips
(`slip_edges`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, hypot, inf, nan, sqrt

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.measures.cycle_measures import LEAST_CYCLES, Cycle, CycleMeans, Measures
from stickslip_ros.measures.noise import (
    FEWEST_SAMPLES,
    NOISE_RANGE,
    NOISE_SAMPLES,
    ROUNDING,
    encoder_step,
    white_noise,
)
from stickslip_ros.measures.parabolas import parabolas
from stickslip_ros.measures.slip_edges import Rest, SlipEdges, edge, slip_edges

_REST_SHARE = 0.5
"""Speed up to which a slide may rest, and error of the speed in rests up to which they may be some,
in mean speeds."""
_FEWEST_REACHES = 16
"""Number of samples, in lengths of a mean, from which rests are looked for."""
_SURE = 3.0
"""Standard errors by which a difference is no error."""
_LEAST_CREEP = 0.01
"""Speed in the rests, in mean speeds, up to which they are rests whatever its error."""
_CREEP = 0.03
"""Speed in the rests, in mean speeds, up to which they are rests if it is within its error."""
_CREEP_ERROR = 0.02
"""Largest standard error of the speed in the rests, in mean speeds, with which they are known."""
_CYCLE_CREEP_ERROR = 0.06
"""Largest standard error of the speed in the rest of a single cycle, in mean speeds, likewise."""
_PASSING = 4.0
"""Speed in the rests, in its standard errors, from which the slide passes."""
_CYCLE_PASSING = 0.1
"""Speed in what looks like the rest of a single cycle, in mean speeds, from which it moves."""
_TURNING = 0.1
"""Share of a single cycle on a guide at rest up to which it may be slow only where it turns."""
_COARSE = 0.05
"""Length of a mean, in cycles, from which a single cycle does not show whether, and how long, it
rests, unless the mean is one of the fewest samples."""
_LEAST_RIDE = 1e-3
"""Speed in the rests, in belt speeds, from which the velocity of the belt may be wrong."""
_MOST_RIDE = 0.07
"""Speed in the rests, in belt speeds, by which the velocity of the belt may be wrong at most."""
_SAME_PERIOD, _SAME_STICK = 0.01, 0.15
"""Relative difference of the periods, and that of the stick fractions, of the same cycles."""
_MOST_ERROR = 0.08
"""Error of a stick fraction up to which it tells how rests move, and whether another agrees."""
_TAIL = 2048
"""Number of last samples in which cycles are looked for first."""
_GROWTH = 4
"""Growth of this number while cycles are few."""
_PASSES = 3
"""Passes in which the velocity of the belt is corrected."""
_SHORTH = 0.2
"""Share of the velocities that are alike while a slide rests."""
_NEGLIGIBLE = 0.05
"""Velocity of a rest, in mean speeds, that is none."""
_CUT = 0.25
"""Time from the first sample to a release, in slip times, below which they begin with its slip."""
_NO_FEED = 0.02
"""Travel on, as a share of that to and fro, that is none."""
_BETWEEN = 0.7
"""Error of an amplitude by an extreme between two samples of a slip, in amplitudes over the square
of their number."""
_EXTREME_ERROR = 0.15
"""Error of an amplitude by the noise or the step of the sensor, in the larger of them."""
_BLOCKS = 4096
"""Number of means of positions from which the mean speed is taken."""
_STEPS = 1.3
"""Least travel between two means, in steps of the encoder."""
_DEVIATIONS = 3.5
"""Least change of the travel between two means that is no rest, in its standard deviations."""
_LEAST, _MOST = 2, 1e9
"""Least and largest number of positions in a mean."""
_LEAST_STEPS = 3.5
"""Travel between two rests that is a slip, in steps of the encoder, at least."""
_LEAST_NOISES = 5.0
"""Travel between two rests that is a slip, in standard deviations of the noise, at least."""
_LEAST_SHARE = 0.1
"""Travel between two rests that is a slip, in large slips, at least."""
_MAIN_SHARE = 0.35
"""Travel of a slip, in large ones, from which a cycle may begin with it."""
_LONG_GAP = 3.0
"""Time between two releases, in periods, after which cycles begin again."""
_SMOOTH_SHARES = 0.05, 0.1
"""Half of the width of the parabola for displacement and velocity, in slip times."""
_WIDEST = 40
"""Half of the width of a parabola, in samples, at most."""
_CORE = 0.15
"""Share of a rest at its edges that does not count for its speed."""


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
        moves_on = abs(self.creep) > max(_CREEP, _PASSING * self.creep_error)
        return moves_on and self.errors.stick_fraction <= _MOST_ERROR

    @property
    def rides(self) -> bool:
        """Whether what looks like rests moves on slowly, as on a belt of another velocity."""
        slow = _LEAST_RIDE < abs(self.creep) < _MOST_RIDE
        return slow and abs(self.creep) > _SURE * self.creep_error

    def agrees(self, measures: Measures) -> bool:
        """Return whether measures that were found otherwise are those of the same cycles."""
        share, error = self.cycle.stick_fraction, self.errors.stick_fraction
        if measures.stick_fraction is None or error > _MOST_ERROR or not self.same_period(measures):
            return False
        error = hypot(error, (measures.errors or {}).get("stick_fraction", 0.0))
        return abs(measures.stick_fraction - share) < min(_SURE * error, _SAME_STICK)

    def same_period(self, measures: Measures) -> bool:
        """Return whether cycles that were found otherwise have this period."""
        period = measures.period
        return period is not None and abs(period / self.cycle.period - 1.0) < _SAME_PERIOD


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


def stick_share(
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
    reach = _reach(travel, noise, step)
    coarse = reach * travel > _COARSE * size
    if travel <= 0.0 or len(time) < 2 * reach + 2 or (coarse and reach > _LEAST):
        return nan
    least = _least_slip(size, noise, step)
    rests = _apart(relative, _rests(relative, reach, _REST_SHARE * travel * reach), least)
    ends = [Rest(row, row, float(relative[row])) for row in (0, len(time) - 1)]
    around = [ends[0], *(rest for rest in rests if time[rest.last] > start), ends[1]]
    still: list[tuple[float, float]] = []
    for before, rest, after in zip(around, around[1:], around[2:], strict=False):
        edges = [start, end]
        for side, other in enumerate((before, after)):
            if abs(other.level - rest.level) <= least:  # it comes back, or does not leave
                other = _farthest(relative, rest, other)
            if abs(other.level - rest.level) > least:
                edges[side] = edge(time, relative, rest, other, noise, step)[0]
        still.append((max(edges[0], start), min(edges[1], end)))
    stick_time = sum(max(release - landing, 0.0) for landing, release in still)
    if stick_time == 0.0:
        return nan if coarse else 0.0
    creep, error = np.array(_creep(time, relative, still, noise, step)) * period / size
    if abs(creep) > max(_CYCLE_PASSING, _PASSING * error):
        return 0.0
    known = abs(creep) <= max(_CREEP, _SURE * error) and error <= _CYCLE_CREEP_ERROR
    known &= belt_velocity != 0.0 or stick_time > _TURNING * period
    return stick_time / period if known and stick_time < period else nan


def resting_velocity(time: FloatArray, position: FloatArray) -> float:
    """Return the velocity, m/s, that positions, m, at times, s, have for longest.

    One that is small against the mean speed is 0. It is the mean of the shortest interval with a
    fifth of the velocities, by the change of two means (the shorth: D. F. Andrews et al., Robust
    Estimates of Location, 1972).
    """
    last = position[-NOISE_SAMPLES:]
    noise, step = white_noise(last), encoder_step(last)
    speed = _mean_speed(time, position, noise, step)
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
    if len(time) < FEWEST_SAMPLES or np.any(np.diff(time) < 0.0) or not time[-1] > time[0]:
        return None
    relative = position - guide_velocity * (time - time[0])
    last = relative[-NOISE_SAMPLES:]
    noise, step = white_noise(last), max(step, encoder_step(last, ROUNDING))
    speed = abs(belt_velocity) or _mean_speed(time, relative, noise, step)
    sample_period = float(time[-1] - time[0]) / (len(time) - 1)
    rests = _rests_apart(relative, speed * sample_period, noise, step)
    starts = _cycle_starts(time, rests)[-most_cycles - 1 :]
    if not starts:
        return None
    between = pairwise(rests[starts[0] : starts[-1] + 2])
    used = [slip_edges(time, relative, before, after, noise, step) for before, after in between]
    if used[0].release - float(time[0]) < _CUT * used[0].duration:  # they begin after it
        used, starts = used[starts[1] - starts[0] :], starts[1:]
    release = np.array([used[start - starts[0]].release for start in starts])
    if len(starts) <= LEAST_CYCLES or not np.all(np.diff(release) > 0.0):  # times that repeat
        return None
    del used[-1]
    period = float(release[-1] - release[0]) / (len(release) - 1)
    durations = np.add.reduceat([slip.duration for slip in used], np.array(starts[:-1]) - starts[0])
    shares = 1.0 - durations / np.diff(release)
    travel = np.array([slip.travel for slip in used])
    onward = abs(float(np.sum(travel))) >= _NO_FEED * float(np.sum(np.abs(travel)))
    feed = float(np.sum(travel)) / float(release[-1] - release[0]) if onward else 0.0
    if not belt_velocity:
        position = position - feed * (time - time[0])
    width = float(np.median([slip.duration for slip in used]))
    width = max(width * (len(time) - 1) / float(time[-1] - time[0]), 1.0)
    extremes, rounded = _extremes(time, position, release, width, max(step, noise))
    columns = [*extremes, np.diff(release), 1.0 / np.diff(release), shares]
    means = CycleMeans.over([Cycle(*measures) for measures in np.transpose(columns).tolist()])
    still = [(before.landing, after.release) for before, after in pairwise(used)]
    creep, creep_error = _creep(time, relative, still, noise, step)
    unit = abs(belt_velocity) or speed
    if creep_error > _REST_SHARE * unit:
        return None
    return StickSlip(
        cycle=replace(
            means.cycle,
            frequency=1.0 / period,
            stick_fraction=1.0 - float(np.sum(durations)) / float(release[-1] - release[0]),
        ),
        errors=_errors(means, used, width, hypot(_EXTREME_ERROR * max(step, noise), rounded)),
        sticks=True,
        amplitudes=means.amplitudes,
        end=float(release[-1]),
        feed=feed,
        creep=creep / unit,
        creep_error=creep_error / unit,
        slip_samples=width,
    )


def _errors(means: CycleMeans, slips: list[SlipEdges], width: float, extreme: float) -> Cycle:
    """Return the standard errors of means, with those of the edges and the extremes.

    A slip has `width` rows; `extreme` is the error of an amplitude by the sensor and by corners, m.
    """
    errors, cycle, count = means.errors, means.cycle, len(means.amplitudes)
    assert errors is not None  # of three cycles
    edges = np.mean([slip.errors for slip in slips], axis=0) * len(slips) / count / cycle.period
    extreme = hypot(extreme, _BETWEEN * cycle.amplitude / width**2)
    return replace(
        errors,
        amplitude=hypot(errors.amplitude, extreme),
        midpoint=hypot(errors.midpoint, extreme),
        stick_fraction=hypot(errors.stick_fraction, float(np.hypot(*edges))),
    )


def _mean_speed(time: FloatArray, position: FloatArray, noise: float, step: float) -> float:
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


def _reach(travel: float, noise: float, step: float) -> int:
    """Return the number of positions in each of two means between which a slide rests or moves.

    `travel` is the mean distance between two samples, m.
    """
    if travel <= 0.0:
        return 0
    by_noise = (_DEVIATIONS * sqrt(2.0) * noise / (_REST_SHARE * travel)) ** (2.0 / 3.0)
    return ceil(min(max(by_noise, _STEPS * step / travel, _LEAST), _MOST))


def _changes(position: FloatArray, reach: int) -> FloatArray:
    """Return the sum of each `reach` positions less that of as many before."""
    total = np.zeros(len(position) + 1)
    np.cumsum(position - position[0], out=total[1:])
    return total[2 * reach :] - 2.0 * total[reach:-reach] + total[: -2 * reach]


def _rests(position: FloatArray, reach: int, most: float) -> list[Rest]:
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


def _rests_apart(position: FloatArray, travel: float, noise: float, step: float) -> list[Rest]:
    """Return the rests between slips; `travel` is the mean between two samples, m."""
    reach = _reach(travel, noise, step)
    if travel <= 0.0 or len(position) < _FEWEST_REACHES * reach:
        return []
    rests = _rests(position, reach, _REST_SHARE * travel * reach)
    if len(rests) < 2:
        return []
    large = _large(np.abs(np.diff([rest.level for rest in rests])))
    return _apart(position, rests, _least_slip(large, noise, step))


def _least_slip(large: float, noise: float, step: float) -> float:
    """Return the least travel between two rests that is a slip, m; `large` is a usual one."""
    return max(_LEAST_STEPS * step, _LEAST_NOISES * noise, _LEAST_SHARE * large)


def _farthest(position: FloatArray, rest: Rest, other: Rest) -> Rest:
    """Return the row between two rests whose position is farthest from the first, as a rest."""
    begin, end = sorted((rest, other))
    rows = slice(begin.last, end.first + 1)
    row = begin.last + int(np.argmax(np.abs(position[rows] - rest.level)))
    return Rest(row, row, float(position[row]))


def _apart(position: FloatArray, rests: list[Rest], least: float) -> list[Rest]:
    """Return rests as one between which no slip of the `least` travel, m, leads away.

    Between its slips a slide creeps, and seems to rest more than once.
    """
    if not rests:
        return []
    apart, longest = rests[:1], rests[0]
    for rest in rests[1:]:
        away = abs(_farthest(position, longest, rest).level - longest.level)
        if max(away, abs(rest.level - longest.level)) > least:
            apart.append(rest)
            longest = rest
        else:
            longest = max(longest, rest, key=lambda rest: rest.last - rest.first)
            apart[-1] = Rest(apart[-1].first, rest.last, longest.level)
    return apart


def _large(sizes: FloatArray) -> float:
    """Return the mean of large sizes: from half of the one that a tenth exceeds."""
    return float(np.mean(sizes[sizes >= np.quantile(sizes, 0.9) / 2.0]))


def _cycle_starts(time: FloatArray, rests: list[Rest]) -> list[int]:
    """Return the numbers of the rests after which the last cycles begin, and after which they end.

    Where main slips to and fro take turns, two of them are a cycle.
    """
    if len(rests) < 2:
        return []
    travel = np.diff([rest.level for rest in rests])
    main = np.flatnonzero(np.abs(travel) >= _MAIN_SHARE * _large(np.abs(travel)))
    forward = travel[main] > 0.0
    turns = np.count_nonzero(forward[1:] != forward[:-1])
    if turns > len(main) // 2:
        main = main[forward]
        forward = forward[forward]
    release = time[[rests[number].last for number in main]]
    if len(main) <= LEAST_CYCLES:
        return []
    gaps = np.diff(release)
    breaks = (gaps > _LONG_GAP * np.median(gaps)) | (forward[1:] != forward[:-1])
    parts = np.split(main, np.flatnonzero(breaks) + 1)
    return next((part.tolist() for part in parts[::-1] if len(part) > LEAST_CYCLES), [])


def _extremes(
    time: FloatArray, position: FloatArray, release: FloatArray, width: float, resolution: float
) -> tuple[FloatArray, float]:
    """Return amplitudes, velocity amplitudes and midpoints of the cycles from release to release.

    Of parabolas through the samples around each (Savitzky and Golay, Analytical Chemistry 36,
    1964): displacements are extreme at a vertex, within shares of the `width` of a slip, in rows.
    A parabola rounds a corner, the more the longer it reaches: while half of its reach changes the
    mean amplitude by more than half of the `resolution`, m, the reach is halved. Also returns the
    last change, m, which is an error.
    """
    rows: list[int] = np.searchsorted(time, release).tolist()
    narrow, wide = (max(int(min(share * width, _WIDEST)), 1) for share in _SMOOTH_SHARES)
    first, last = max(rows[0] - wide, 0), rows[-1] + wide + 1
    period = float(time[-1] - time[0]) / (len(time) - 1)
    part = position[first:last]
    cycles = [slice(start - first, end - first + 1) for start, end in pairwise(rows)]
    (high, low), rounded = _displacements(part, cycles, narrow), 0.0
    while narrow > 1:
        narrow //= 2
        highest, lowest = _displacements(part, cycles, narrow)
        change = float(np.mean(highest - lowest - (high - low))) / 2.0
        if change <= resolution / 2.0:
            rounded = max(change, 0.0)
            break
        high, low, rounded = highest, lowest, change
    speed = parabolas(part, wide)[1] / period
    swings = [high - low, [np.ptp(speed[cycle]) for cycle in cycles], high + low]
    return np.array(swings) / 2.0, rounded


def _displacements(
    course: FloatArray, cycles: Sequence[slice], reach: int
) -> tuple[FloatArray, FloatArray]:
    """Return the highest and the lowest displacement of each cycle, by parabolas of a reach."""
    smooth, slope, bend = parabolas(course, reach)
    # At a corner, as of a flat top, the rows beside it do not bend so, and there is no vertex.
    bends = np.pad(np.abs(bend), 1, mode="edge")
    least = np.minimum(np.minimum(bends[:-2], bends[2:]), bends[1:-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        smooth -= np.where(np.abs(slope) < 2.0 * least, slope**2 / (4.0 * bend), 0.0)
    parts = [smooth[cycle] for cycle in cycles]
    return np.array([part.max() for part in parts]), np.array([part.min() for part in parts])


def _creep(
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
