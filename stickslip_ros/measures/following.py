"""How a slide follows a reference: its following error, and the error where the reference turns."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, rms
from stickslip_ros.measures.noise import unresolved
from stickslip_ros.quantities import Quantity
from stickslip_ros.samples import LARGEST
from stickslip_ros.text import quantity

_LEAST_WAY, _JUMP = 0.05, 0.2
"""Least way back of a reversal, as a share of the range of the reference; share of the way between
two reversals from which a single step of the reference is a jump, and no motion."""
_WINDOW = 0.25
"""Share of the time to the next reversal in which the error counts as that of a reversal."""
_FAST, _VARIED, _UNCLEAR = 0.3, 0.15, 0.1
"""Share of the largest speed from which the lag is fitted; deviation of these speeds, as a share of
their mean, from which a lag and an error that only has a direction are told apart; largest share of
a height that may be lag."""
_STANDS, _NATURAL = 1e-3, 3.0
"""Share of the height within which a slide that stands may move; times that a slide without error
would seem to stand, from which it is a rest."""
_LEAST_HEIGHT, _FEWEST_SAMPLES = 1e-6, 3
"""Least height of an error, as a share of the range of the reference; fewest samples above half of
it."""


@dataclass(frozen=True)
class Following:
    """Following error, reference less position, and the error at reversals; None is unknown.

    A reversal is where the reference starts to move against its last direction, by at least 5 % of
    its range. The error at a reversal, known as quadrant glitch, is what circular tests (ISO 230-4)
    show as spikes where an axis turns. It is taken in the first quarter of the time to the next
    reversal (45 degrees of a circle), less what is constant, grows with the speed (lag) or with the
    position (scale, and on a circle inertia). The values at reversals are means over them.
    """

    rms_following_error: Annotated[float | None, Quantity("rms following error", "m")] = None
    """Root mean square, m, from the first reversal on, or without one of the whole run."""
    peak_following_error: Annotated[float | None, Quantity("peak following error", "m")] = None
    """Largest magnitude in this time, m."""
    reversals: Annotated[int | None, Quantity("reversals")] = None
    """Number of reversals whose error is measured."""
    reversal_height: Annotated[float | None, Quantity("error at reversals", "m")] = None
    """How far the slide gets behind, m, or ahead of where it was at the reversal, if that is more.
    Of a play it is half of it, as the other half is the error before the reversal."""
    reversal_height_error: Annotated[float | None, Quantity("its standard error", "m")] = None
    """Standard error from the scatter of the reversals, m; None of a single one."""
    reversal_duration: Annotated[float | None, Quantity("duration of this error", "s")] = None
    """Full width at half the height, s; None if the error stays, as that of a play."""
    reversal_rest: Annotated[float | None, Quantity("rest at reversals", "s")] = None
    """Time that the slide stands after the reversal, s, within a thousandth of the height or the
    resolution; None if it is less than two samples, or than three times that without an error."""


class Reversal(NamedTuple):
    """A reversal, and its error in the window of `Following`; None is unknown."""

    time: FloatArray
    """Time since the reversal, s, shape (samples,)."""
    behind: FloatArray
    """Error against the new direction, less what is not of the reversal, m."""
    height: float
    duration: float | None
    rest: float | None
    wide: int
    """Number of samples above half the height."""
    unclear: float
    """How much of the height may be lag, m."""


class Followed(NamedTuple):
    """How a run follows its reference; times in s, errors in m."""

    values: Following
    notes: Sequence[str]
    """Sentences that say why a value is not known."""
    time: FloatArray
    error: FloatArray
    """Following error."""
    turns: Sequence[Reversal]


def followed(
    time: FloatArray, reference: FloatArray, position: FloatArray, unit: str = "m"
) -> Followed | None:
    """Return how positions follow a reference; None if there are not two samples of both.

    Arrays have the shape (samples,), s and m; rows without a number up to 1e100, or not later
    than all before, are left out. `unit` is that of lengths in the notes, "" for none. With noise,
    heights are those of the error smoothed over a quarter of its width. What the sensor does not
    tell, see `unresolved`, or the samples do not, is None.
    """
    known = (np.abs(reference) <= LARGEST) & (np.abs(position) <= LARGEST)
    known &= time > np.maximum.accumulate(np.append(-np.inf, time))[:-1]
    time, reference, position = time[known], reference[known], position[known]
    if len(time) < 2:
        return None
    error, moves = reference - position, np.abs(np.diff(reference))
    changes = np.append(0, np.flatnonzero(moves) + 1)
    if len(changes) > 1 and np.median(np.diff(changes)) >= 2.0:  # held for several samples
        reference = np.interp(time, time[changes], reference[changes])
    rows = _turning_rows(reference)
    part = error[rows[1] if len(rows) > 2 else 0 :]
    limit = unresolved(position)
    ways = [(a, b, moves[a:b].max(), abs(reference[b] - reference[a])) for a, b in pairwise(rows)]
    smooth = [(a, b) for a, b, step, way in ways if step < _JUMP * way]
    turns = [*_reversals(time, reference, position, smooth, limit)]
    values, notes = Following(rms(part), float(np.abs(part).max()), len(turns)), list[str]()
    if len(turns) < len(rows) - 2:
        notes.append("the reference jumps, or has few samples: no error at such a reversal")
    heights = [turn.height for turn in turns]
    least = max(limit, _LEAST_HEIGHT * float(np.ptp(reference)))
    if turns and np.mean(heights) <= least:
        text = quantity(least, unit)
        notes.append(f"the error at reversals is not known: positions tell none below {text}")
    elif turns and np.median([turn.wide for turn in turns]) < _FEWEST_SAMPLES:
        notes.append("the error at reversals is not known: it is shorter than three samples")
    elif turns and turns[0].unclear > _UNCLEAR * np.mean(heights):
        notes.append("the error at reversals is not known: at a single speed it may be a lag")
    elif turns:
        scatter = float(np.std(heights, ddof=1)) if len(turns) > 1 else None
        values = replace(
            values,
            reversal_height=float(np.mean(heights)),
            reversal_height_error=None if scatter is None else scatter / len(turns) ** 0.5,
            reversal_duration=_usual([turn.duration for turn in turns]),
            reversal_rest=_usual([turn.rest for turn in turns]),
        )
    return Followed(values, notes, time, error, turns)


def _turning_rows(reference: FloatArray) -> list[int]:
    """Return the first row, those where the reference starts back, and the end of its last way."""
    moves = np.diff(reference)
    steps = np.flatnonzero(moves)
    turns = steps[1:][np.diff(np.sign(moves[steps])) != 0.0]
    least, way, rows = _LEAST_WAY * float(np.ptp(reference)), 0.0, [0]
    for row in [*turns.tolist(), len(reference) - 1]:
        move = float(reference[row] - reference[rows[-1]])
        if move * way > 0.0 or (move == 0.0 and way):
            rows[-1] = row
        elif abs(move) > least:
            way = move
            rows.append(row)
    return rows


def _reversals(
    time: FloatArray,
    reference: FloatArray,
    position: FloatArray,
    ways: Sequence[tuple[int, int]],
    limit: float,
) -> Iterator[Reversal]:
    """Yield the reversals of a reference between the `ways`, of which some may be left out.

    These have a first and a last row; `limit` is what positions do not tell, m.
    """
    beside = [(a, b, end) for (a, b), (c, end) in pairwise(ways) if b == c]
    if not beside:
        return
    behind, unclear = _without_lag(time, reference, reference - position, beside[0][1])
    for before, row, after in beside:
        length = time[after] - time[row]
        if after == ways[-1][1]:  # of the last way the end is not known
            length = min(length, time[row] - time[before])
        ends = time[row] + np.array([-_WINDOW, _WINDOW]) * length
        start, stop = np.searchsorted(time, ends).tolist()
        if stop - row < 2:
            continue
        way, since = np.sign(reference[after] - reference[row]), time[start:stop] - time[row]
        error = way * behind[row:stop]
        height, duration, wide = _peak(since[row - start :], error, smoothed=limit > 0.0)
        least = max(limit, _STANDS * height)
        course, ideal = way * position[start:stop], way * reference[start:stop]
        rest = _standing(since, course, int(np.argmin(course)), least)
        natural = _standing(since, ideal, row - start, least)
        is_told = rest > max(_NATURAL * natural, 2.0 * (time[row + 1] - time[row]))
        rested = rest if is_told else None
        yield Reversal(since[row - start :], error, height, duration, rested, wide, unclear)


def _without_lag(
    time: FloatArray, reference: FloatArray, error: FloatArray, start: int
) -> tuple[FloatArray, float]:
    """Return an error less what is constant, or in proportion to the speed or the position.

    These are fitted to the fast parts from a row on, with what has only the sign of the speed. At a
    single speed a lag cannot be told from that, and is left in the error: the second value, m.
    """
    place = (reference - reference.mean()) / float(np.ptp(reference))
    speed = np.gradient(reference, time)
    speed /= np.abs(speed[start:]).max()  # what came before may be far faster
    fast = np.flatnonzero(np.abs(speed[start:]) > _FAST) + start
    sizes, ones = np.abs(speed[fast]), np.ones(len(fast))
    causes = np.column_stack([np.sign(speed[fast]), ones, place[fast], speed[fast]])
    single = sizes.std() <= _VARIED * sizes.mean()
    if single:
        causes[:, 3] = 0.0
    sign, constant, scale, lag = np.linalg.lstsq(causes, error[fast])[0].tolist()
    return error - constant - scale * place - lag * speed, abs(sign) if single else 0.0


def _peak(
    time: FloatArray, behind: FloatArray, *, smoothed: bool
) -> tuple[float, float | None, int]:
    """Return height (m), duration (s) and the number of samples above half the height."""
    ahead = behind[0] - behind
    error = behind if behind.max() >= ahead.max() else ahead
    if smoothed:
        from scipy.ndimage import uniform_filter1d  # it takes long to import

        wide = np.count_nonzero(error > 0.5 * error.max())
        error = uniform_filter1d(error, 1 + wide // 4, mode="nearest")
    first, last = _around(error <= 0.5 * error.max(), int(np.argmax(error)))
    ends = last + 1 < len(error)
    duration = float(time[last + 1] - time[first]) if ends else None
    return float(error.max()), duration, last + 1 - first


def _standing(since: FloatArray, course: FloatArray, turn: int, least: float) -> float:
    """Return how long after a reversal, s, a course stays within `least` of its turning point."""
    first, last = _around(course > course[turn] + least, turn)
    return max(float(since[last] - max(since[first], 0.0)), 0.0)


def _around(outside: BoolArray, row: int) -> tuple[int, int]:
    """Return the first and last of the rows around a row that are not outside."""
    out = np.flatnonzero(outside)
    first, last = out[out < row].max(initial=-1) + 1, out[out > row].min(initial=len(outside)) - 1
    return int(first), int(last)


def _usual(values: Sequence[float | None]) -> float | None:
    """Return the mean of values; None if half of them or more are not known."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if 2 * len(known) > len(values) else None
