"""Parabolas of least squares through samples: values, slopes, extremes.

They are those of A. Savitzky and M. J. E. Golay, Analytical Chemistry 36, 1964.
"""

from functools import lru_cache

import numpy as np

from stickslip_ros.arrays import FloatArray


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


def slopes(course: FloatArray, reach: int) -> FloatArray:
    """Return the slopes, in rows, of those parabolas that have `reach` rows on both sides."""
    return np.convolve(course - course[0], _least_squares(reach)[1][::-1], "valid")


def vertex(course: FloatArray) -> tuple[float, float]:
    """Return where, in rows from the middle of an odd number, a parabola is extreme, and its value.

    Where it has no bend, it is the middle.
    """
    reach = len(course) // 2
    base = float(course[reach])
    value, slope, bend = (_least_squares(reach) @ (course - base)).tolist()
    lag = min(max(-slope / (2.0 * bend), -reach), reach) if bend else 0.0
    return lag, base + value + lag * (slope + lag * bend)
