"""Updates of positions that are recorded faster than they are updated.

Between updates a recorder repeats the last value, or puts the rows on a line to the next one.
"""

from collections.abc import Sequence

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.measures.noise import NOISE_SAMPLES, encoder_step

_FEWEST, _MOST_ROWS, _JUDGED = 16, 100, 32_768
"""Fewest updates, most sample periods between two, and number of rows by which this is judged."""
_USUAL, _RARE = 0.6, 0.1
"""Share of the updates that follow the one before after one period, within a row; share that comes
sooner, as where rows are missing."""
_ROUNDED_STEPS, _ROUNDED_SHARE, _ONE_STEP = 2.5, 1e-3, 1.5
"""Largest bend of a line by rounding, in steps of the values and as a share of the largest bend;
steps of the values below which a change is a single one."""


def updated(time: FloatArray | IntArray, columns: Sequence[FloatArray]) -> tuple[float, BoolArray]:
    """Return the sample periods from update to update, and at which rows there is one.

    It is that of the column that is updated least often; 1 if each row is an update. Of a column
    alone, single steps of an encoder are no updates: they are seen as what they are. Rows may be
    missing; `time` is that of each, in any unit.
    """
    every, own = 1.0, np.ones(len(time), np.bool_)
    for column in columns:
        rows = np.flatnonzero(np.isfinite(column))
        moving = np.flatnonzero(column[rows[1:]] != column[rows[:-1]])
        if len(moving) < _FEWEST:
            continue
        middle = int(moving[len(moving) // 2])
        part = rows[max(middle - _JUDGED // 2, 0) : middle + _JUDGED // 2]
        number, value = _numbered(time[part]), column[part]
        if len(columns) == 1 and _is_coarse(value):
            continue
        for updates_in in (_changes, _knots):
            period = _period_of(number[updates_in(number, value)])
            if period > every:
                every, whole = period, _numbered(time)
                at = whole[rows[updates_in(whole[rows], column[rows])]]
                own = np.isin(whole, _filled(at, period, int(whole[-1])))
    return every, own


def _numbered(time: FloatArray | IntArray) -> IntArray:
    """Return the number of sample periods from the first row to each; of a long pause, a few."""
    steps = np.diff(time)
    periods = np.clip(np.rint(steps / (np.median(steps) or 1)), -_MOST_ROWS, _MOST_ROWS)
    return np.cumsum(np.append(0, periods)).astype(np.int64)


def _is_coarse(value: FloatArray) -> bool:
    """Return whether a value changes by single steps."""
    with np.errstate(over="ignore", invalid="ignore"):
        changes = np.abs(np.diff(value))
    usual = np.median(changes[changes > 0.0])
    return bool(usual < _ONE_STEP * encoder_step(value[-NOISE_SAMPLES:]))


def _changes(number: IntArray, value: FloatArray) -> IntArray:
    """Return the rows at which a value changes."""
    return np.flatnonzero(value[1:] != value[:-1]) + 1


def _knots(number: IntArray, value: FloatArray) -> IntArray:
    """Return the rows nearest to the ends of lines on which all values lie; none without lines."""
    with np.errstate(over="ignore", invalid="ignore"):
        bends = np.abs(np.diff(np.diff(value) / np.maximum(np.diff(number), 1)))
    rounding = _ROUNDED_STEPS * encoder_step(value[-NOISE_SAMPLES:])
    bent = np.flatnonzero(bends > max(rounding, _ROUNDED_SHARE * bends.max(initial=0.0)))
    # A line that ends between two rows bends at both of them.
    first = bent[np.diff(bent, prepend=-2) > 1]
    if len(bent) > 2.0 * (1.0 + _RARE) * len(first):
        return bent[:0]
    second = np.minimum(first + 1, len(bends) - 1)
    return np.where(bends[second] > bends[first], second, first) + 1


def _period_of(updates: IntArray) -> float:
    """Return the mean number of sample periods between updates; 1 where they are not even."""
    if len(updates) < _FEWEST:
        return 1.0
    apart = np.diff(updates)
    usual = apart[np.abs(apart - np.sort(apart)[len(apart) // 2]) <= 1]
    period = float(usual.mean())
    even = np.mean(np.abs(apart - period) < 1.0) >= _USUAL
    few = np.mean(apart <= period - 1.0) <= _RARE
    return period if even and few and 2.0 <= period <= _MOST_ROWS else 1.0


def _filled(updates: IntArray, period: float, last: int) -> IntArray:
    """Return updates up to the number `last` with those that show no change."""
    before = updates[0] - np.rint(period * np.arange(updates[0] // period, 0.0, -1.0))
    after = updates[-1] + np.rint(period * np.arange(1.0, (last - updates[-1]) // period + 1.0))
    gaps = np.diff(updates)
    count = np.maximum(np.rint(gaps / period), 1.0).astype(np.int64)
    place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    between = np.repeat(updates[:-1], count) + np.rint(place * np.repeat(gaps / count, count))
    return np.concatenate([before, between, updates[-1:], after]).astype(np.int64)
