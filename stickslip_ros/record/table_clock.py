"""The times of a table: whether they are rounded, what they were before, and their stamps."""

from pathlib import Path

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray, windows
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import quantity

LONGEST = 9e9
"""Longest time, s, that stamps can express."""
_FEWEST, _MOST = 10, 100_000
"""Fewest rows of a part that is evenly spaced; rows in which a rounding is looked for."""
_COARSE_SHARE, _COMMON_SHARE, _MULTIPLE = 0.02, 0.02, 1e-3
"""Least step of a rounding, as a share of the period; share of the steps of time from which one is
usual: others are gaps and lost rows; distance of a multiple, in steps of the rounding."""


def even_times(time: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return even times, s, for times that are even up to a rounding, and sentences on them.

    Between gaps of more than two steps of the rounding, they must be on a line to within a step.
    """
    if len(time) < _FEWEST or time[-1] > LONGEST:
        return time, []
    rounding, notes = _rounding(np.diff(time[:_MOST])), list[str]()
    if rounding:
        steps = np.diff(time)
        gaps = np.flatnonzero(steps > np.median(steps) + 2.5 * rounding) + 1
        parts = [_even(part, rounding) for part in np.split(time, gaps)]
        found = np.concatenate([time[:0], *(part for part in parts if part is not None)])
        if len(found) == len(time):
            period = quantity(float(np.median(np.diff(found))), "s")
            return found - found[0], [
                f"the times are rounded to {quantity(rounding, 's')}: the rows are taken as evenly "
                f"spaced, {period} apart"
            ]
        multiples, digits = steps / rounding, np.log10(rounding)
        whole = np.abs(multiples - np.rint(multiples)) < _MULTIPLE
        if np.mean(whole) > 1.0 - _COMMON_SHARE and abs(digits - round(digits)) < _MULTIPLE:
            share = rounding / float(np.median(steps))
            notes = [
                f"the times are multiples of {quantity(rounding, 's')}: if they are rounded, "
                f"velocities err by {share:.0%}"
            ]
    if stand := np.count_nonzero(time[1:] == time[:-1]):
        notes.append(f"{stand} of {len(time)} rows have the time of the row before")
    return time, notes


def stamps_of(path: Path, time: FloatArray) -> IntArray:
    """Return times, s, as stamps, ns, from the first one; InvalidInputError if they are too far."""
    if max(time.max(), -time.min()) > LONGEST:
        raise InvalidInputError(f"{path}: the times differ by more than {LONGEST:g} s")
    stamp = np.empty(len(time), np.int64)
    for part in windows(len(time)):
        stamp[part] = np.rint(time[part] * NANOSECONDS)
    return stamp


def _rounding(steps: FloatArray) -> float:
    """Return the least difference of usual steps, s; 0 if it is a small share of them."""
    sizes, counts = np.unique(np.rint(steps * NANOSECONDS), return_counts=True)
    sizes = sizes[counts >= _COMMON_SHARE * counts.sum()] / NANOSECONDS
    step = float(np.diff(sizes).min(initial=np.inf))
    return step if _COARSE_SHARE * float(np.median(steps)) <= step < np.inf else 0.0


def _even(time: FloatArray, rounding: float) -> FloatArray | None:
    """Return the times of a part on a line, those of a short one as they are; None without one."""
    if len(time) < _FEWEST:
        return time
    rows = np.arange(len(time), dtype=np.float64)
    period = float(np.polyfit(rows, time - time[0], 1)[0])
    short = (float(f"{period:.{digits}g}") for digits in range(1, 10))
    near = 0.05 * rounding / len(time)
    line = rows * next((each for each in short if abs(each - period) < near), period)
    apart = time - line
    if np.ptp(apart) > 1.05 * rounding:
        return None
    return line + float(apart.min() + apart.max()) / 2.0
