"""The search for gains of a control law: those that damp fastest at all feeds, within limits."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from itertools import product
from math import ceil, floor, inf, log10
from typing import TypeVar

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import ControlLaw

_Law = TypeVar("_Law", bound=ControlLaw)
_Value = tuple[float, float]

_SCANNED = 256, 2048, 4096
"""Points of the first scan, with one gain, with two, and with more."""
_VALUED, _REFINED = 60, 4
"""Points of it that are compared with the limits, and those from which the search goes on."""
_FIRST_STEP, _LAST_STEP, _MOVES = 1.0, 0.03, 40
"""Steps of a refinement, as logarithms, and largest number of them."""


def fastest(
    decay_rates: Callable[[Sequence[_Law]], FloatArray],
    ends: tuple[FloatArray, FloatArray],
    law_at: Callable[[FloatArray], _Law],
    excess: Callable[[_Law], Iterable[float]],
) -> tuple[_Value, _Law]:
    """Return the law with the smallest total excess over its limits.

    Among laws of equal excess it is that with the largest decay rate.

    Points between the ends are scanned evenly; the best are refined by ever smaller steps.

    Parameters
    ----------
    decay_rates : callable
        Returns the smallest decay rate with each law, 1/s.
    ends : tuple of ndarray
        Lowest and highest points, logarithms of magnitudes, shape (n,) each.
    law_at : callable
        Returns the law that a point stands for.
    excess : callable
        Returns by how much, as logarithms, a stable law exceeds limits.

    Returns
    -------
    tuple
        Its value and the law. A value is the excess in all, less than or equal to zero and
        -infinity of an unstable law, and the smallest decay rate, 1/s.
    """

    @cache
    def exceeded(law: _Law) -> float:
        return -ceil(100.0 * sum(excess(law))) / 100.0  # so that less excess is not too slow

    def valued(law: _Law, rate: float) -> _Value:
        return (exceeded(law) if rate > 0.0 else -inf, rate)

    points = _evenly(*ends)
    laws = [law_at(point) for point in points]
    rates = decay_rates(laws)
    order = np.argsort(-rates)
    stable = int((rates > 0.0).sum())
    places = {*range(_VALUED // 3), *np.linspace(0, max(stable - 1, 0), _VALUED).astype(int)}
    chosen = [order[place] for place in sorted(places)]
    tops = [(valued(laws[row], float(rates[row])), tuple(points[row].tolist())) for row in chosen]
    best = sorted(tops, reverse=True)[:_REFINED]
    refined = (_refined(decay_rates, ends, law_at, valued, *top) for top in best)
    return max(refined, key=lambda pair: pair[0])


def _refined(
    decay_rates: Callable[[Sequence[_Law]], FloatArray],
    ends: tuple[FloatArray, FloatArray],
    law_at: Callable[[FloatArray], _Law],
    valued: Callable[[_Law, float], _Value],
    top: _Value,
    place: tuple[float, ...],
) -> tuple[_Value, _Law]:
    """Return the best value and law near a point of some value, by ever smaller steps."""
    point = np.array(place)
    ways = np.array([*product((-1.0, 0.0, 1.0), repeat=len(point))])
    ways = ways[(np.abs(ways).sum(axis=1) > 0.0) & (np.abs(ways).sum(axis=1) < 4.0)]
    step = _FIRST_STEP
    for _ in range(_MOVES):
        around = np.clip(point + step * ways, *ends)
        laws = [law_at(place) for place in around]
        rates = decay_rates(laws)
        # Beside a law within its limits, only faster ones can be better.
        faster = (row for row in np.argsort(-rates).tolist() if top[0] < 0.0 or rates[row] > top[1])
        values = ((valued(laws[row], float(rates[row])), row) for row in faster)
        if top[0] < 0.0:  # some are better by little: the best
            values = iter([max(values)])
        better = next((trial for trial in values if trial[0] > top), None)
        if better is not None:
            top, point = better[0], around[better[1]]
        elif step < _LAST_STEP:
            break
        else:
            step /= 2.0
    return top, law_at(point)


def _evenly(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return points between ends of shape (n,), spread evenly, shape (m, n)."""
    count = len(low)
    # Powers of the root of x^(n+1) = x + 1 spread points most evenly (Roberts, 2018).
    root = max(np.roots([1.0, *[0.0] * (count - 1), -1.0, -1.0]).real)
    numbers = np.arange(1, _SCANNED[min(count, len(_SCANNED)) - 1] + 1)[:, None]
    return low + (high - low) * ((0.5 + numbers * root ** -np.arange(1.0, count + 1.0)) % 1.0)


def rounded(value: float, digits: int = 3, *, up: bool = False) -> float:
    """Return a value rounded to `digits` significant digits, `up` or to the nearest."""
    if value == 0.0:
        return 0.0
    if up:
        unit = 10.0 ** (floor(log10(value)) + 1 - digits)
        value = ceil(value / unit) * unit
    return float(f"{value:.{digits}g}")
