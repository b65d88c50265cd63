"""Rests and moves: the measures of a slide that rests and slips, from its positions.

Relative to the guide a slide rests (`rests`) or moves. Cycles are what repeats from release to
release, at the edges of the slips (`slip_edges`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import LEAST_CYCLES, Cycle, CycleMeans, Measures
from stickslip_ros.measures.noise import (
    FEWEST_SAMPLES,
    NOISE_SAMPLES,
    ROUNDING,
    encoder_step,
    white_noise,
)
from stickslip_ros.measures.parabolas import parabolas
from stickslip_ros.measures.rests import (
    CREEP,
    PASSING,
    REST_SHARE,
    SURE,
    Rest,
    creep_in,
    large_size,
    mean_speed,
    rests_apart,
)
from stickslip_ros.measures.slip_edges import SlipEdges, slip_edges

_LEAST_CREEP = 0.01
"""Speed in the rests, in mean speeds, up to which they are rests whatever its error."""
_CREEP_ERROR = 0.02
"""Largest standard error of the speed in the rests, in mean speeds, with which they are known."""
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
_CUT = 0.25
"""Time from the first sample to a release, in slip times, below which they begin with its slip."""
_NO_FEED = 0.02
"""Travel on, as a share of that to and fro, that is none."""
_BETWEEN = 0.7
"""Error of an amplitude by an extreme between two samples of a slip, in amplitudes over the square
of their number."""
_EXTREME_ERROR, _NOISE_ERROR = 0.15, 0.75
"""Error of an amplitude by the step of the sensor, and by its noise: an extreme of many samples is
the extreme of their noise, too."""
_MAIN_SHARE = 0.35
"""Travel of a slip, in large ones, from which a cycle may begin with it."""
_LONG_GAP = 3.0
"""Time between two releases, in periods, after which cycles begin again."""
_SMOOTH_SHARES = 0.05, 0.1
"""Half of the width of the parabola for displacement and velocity, in slip times."""
_WIDEST = 40
"""Half of the width of a parabola, in samples, at most."""


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
        most = min(max(_LEAST_CREEP, SURE * self.creep_error), CREEP)
        lasting = self.cycle.stick_fraction > SURE * self.errors.stick_fraction
        return lasting and abs(self.creep) <= most and self.creep_error <= _CREEP_ERROR

    @property
    def passes(self) -> bool:
        """Whether the slide is known to move on in what looks like rests."""
        moves_on = abs(self.creep) > max(CREEP, PASSING * self.creep_error)
        return moves_on and self.errors.stick_fraction <= _MOST_ERROR

    @property
    def rides(self) -> bool:
        """Whether what looks like rests moves on slowly, as on a belt of another velocity."""
        slow = _LEAST_RIDE < abs(self.creep) < _MOST_RIDE
        return slow and abs(self.creep) > SURE * self.creep_error

    def agrees(self, measures: Measures) -> bool:
        """Return whether measures that were found otherwise are those of the same cycles."""
        share, error = self.cycle.stick_fraction, self.errors.stick_fraction
        if measures.stick_fraction is None or error > _MOST_ERROR or not self.same_period(measures):
            return False
        error = hypot(error, (measures.errors or {}).get("stick_fraction", 0.0))
        return abs(measures.stick_fraction - share) < min(SURE * error, _SAME_STICK)

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
    speed = abs(belt_velocity) or mean_speed(time, relative, noise, step)
    sample_period = float(time[-1] - time[0]) / (len(time) - 1)
    rests = rests_apart(relative, speed * sample_period, noise, step)
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
    lasting = float(release[-1] - release[0])
    period = lasting / (len(release) - 1)
    durations = np.add.reduceat([slip.duration for slip in used], np.array(starts[:-1]) - starts[0])
    shares = 1.0 - durations / np.diff(release)
    stick_fraction = 1.0 - float(np.sum(durations)) / lasting
    travel = np.array([slip.travel for slip in used])
    onward = abs(float(np.sum(travel))) >= _NO_FEED * float(np.sum(np.abs(travel)))
    feed = float(np.sum(travel)) / lasting if onward else 0.0
    if not belt_velocity:
        position = position - feed * (time - time[0])
    width = float(np.median([slip.duration for slip in used]))
    width = max(width * (len(time) - 1) / float(time[-1] - time[0]), 1.0)
    extremes, rounded = _extremes(time, position, release, width, max(step / 2.0, noise))
    extreme_error = hypot(_EXTREME_ERROR * step, _NOISE_ERROR * noise, rounded)
    columns = [*extremes, np.diff(release), 1.0 / np.diff(release), shares]
    means = CycleMeans.over([Cycle(*measures) for measures in np.transpose(columns).tolist()])
    still = [(before.landing, after.release) for before, after in pairwise(used)]
    creep, creep_error = creep_in(time, relative, still, noise, step)
    unit = abs(belt_velocity) or speed
    if creep_error > REST_SHARE * unit:
        return None
    return StickSlip(
        cycle=replace(means.cycle, frequency=1.0 / period, stick_fraction=stick_fraction),
        errors=_errors(means, used, width, extreme_error),
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


def _cycle_starts(time: FloatArray, rests: list[Rest]) -> list[int]:
    """Return the numbers of the rests after which the last cycles begin, and after which they end.

    Where main slips to and fro take turns, two of them are a cycle.
    """
    if len(rests) < 2:
        return []
    travel = np.diff([rest.level for rest in rests])
    main = np.flatnonzero(np.abs(travel) >= _MAIN_SHARE * large_size(np.abs(travel)))
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
    mean amplitude by more than the `resolution`, m, the reach is halved. Also returns the
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
        if change <= resolution:
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
