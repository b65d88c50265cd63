"""The search for gains of a control law: those that damp fastest at all feeds, within limits."""

from collections.abc import Callable, Iterable, Sequence
from math import ceil, floor, inf, log10
from typing import Any, TypeVar

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import ControlLaw, LinearFeedback
from stickslip_ros.model.drive_layout import SPEED
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop

_Law = TypeVar("_Law", bound=ControlLaw)

_VALUED, _REFINED = 60, 40
"""Starts that are compared with the limits, and largest number of steps of a refinement."""
_FIRST_STEP, _LAST_STEP = 1.0, 0.05
"""Steps of a refinement, in the units of the points."""


class Loops:
    """The sampled loops of a drive at several feeds."""

    def __init__(self, loops: Sequence[LinearSampledLoop]) -> None:
        self.all = loops
        """The loop at each feed."""
        slopes = [float(loop.jacobian[SPEED, SPEED]) for loop in loops]
        self.steepest = max(map(abs, slopes))
        """Largest slope of the friction in magnitude, dimensionless."""
        self.ends = sorted({int(np.argmin(slopes)), int(np.argmax(slopes))})
        """Places of the loops that decide: they differ in the slope of the friction only."""
        self.deciding = [loops[place].coarsened() for place in self.ends]
        """Those loops; with a long delay similar ones."""

    def slowest(self, law: ControlLaw) -> LinearSampledLoop:
        """Return the loop in which a small deviation decays most slowly."""
        return min(self.all, key=lambda loop: loop.decay_rate(law))

    def decay_rates(self, laws: Sequence[ControlLaw]) -> FloatArray:
        """Return the smallest decay rate with each law, 1/s; approximate for a long delay."""
        rates = np.full(len(laws), inf)
        for loop in self.deciding:
            forms = (linear_part(law, loop) for law in laws)
            stacked = LinearFeedback(*map(np.array, zip(*forms, strict=True)))
            radii = np.abs(np.linalg.eigvals(loop.transition_matrix(stacked))).max(axis=-1)
            with np.errstate(divide="ignore"):
                rates = np.minimum(rates, -np.log(radii) * loop.rate)
        return rates


def linear_part(law: ControlLaw, loop: LinearSampledLoop) -> LinearFeedback:
    """Return the linear part of a law at the rate of a loop.

    Raises InvalidInputError if the law has none.
    """
    part = law.linear_part(1.0 / loop.rate)
    if part is None:
        raise InvalidInputError(f"control law {law.name}: it has no linear part to tune")
    return part


def fastest(
    loops: Loops,
    starts: FloatArray,
    law_at: Callable[[FloatArray], _Law],
    excess: Callable[[_Law], Iterable[float]] = lambda _: (),
    *,
    ways: Sequence[Sequence[float]] | None = None,
    kept: int = 6,
) -> _Law | None:
    """Return the law that first exceeds its limits least, and then damps fastest.

    Parameters
    ----------
    loops : Loops
        The loops.
    starts : ndarray
        Points where the search starts, shape (m, n); the best `kept` of them are refined,
        with ever smaller steps from 1 on.
    law_at : callable
        Returns the law that a point stands for.
    excess : callable
        Returns by how much, as logarithms, a stable law exceeds limits.
    ways : sequence
        Directions of the first steps, n numbers each; by default both ways along each axis.
    kept : int
        Number of starts that are refined.

    Returns
    -------
    ControlLaw or None
        The law; None if no gains make all loops stable.
    """

    def valued(points: Iterable[FloatArray]) -> Any:
        """Return the value of each point, what is made large first, and the point."""
        places = [tuple(point.tolist()) for point in points]
        laws = [law_at(np.array(place)) for place in places]
        rates = loops.decay_rates(laws).tolist()
        for place, law, rate in zip(places, laws, rates, strict=True):
            yield (-sum(excess(law)) if rate > 0.0 else -inf, rate), place

    axes = np.eye(starts.shape[1])
    steps = np.vstack([axes, -axes]) if ways is None else np.array(ways)

    def refined(top: Any) -> Any:
        """Return the best value and point, with ever smaller steps."""
        step = _FIRST_STEP
        for _ in range(_REFINED):
            best = max(valued(np.array(top[1]) + step * steps))
            if best[0] > top[0]:
                top = best
            elif step < _LAST_STEP:
                break
            else:
                step /= 2.0
        return top

    order = np.argsort(loops.decay_rates([law_at(start) for start in starts]))[::-1]
    best = sorted(valued(starts[order[:_VALUED]]), reverse=True)[:kept]
    (_, decay_rate), point = max(map(refined, best))
    return law_at(np.array(point)) if decay_rate > 0.0 else None


def rounded(value: float, digits: int = 3, *, up: bool = False) -> float:
    """Return a value rounded to `digits` significant digits, `up` or to the nearest."""
    if value == 0.0:
        return 0.0
    if up:
        unit = 10.0 ** (floor(log10(value)) + 1 - digits)
        value = ceil(value / unit) * unit
    return float(f"{value:.{digits}g}")
