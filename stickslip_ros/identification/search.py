"""Search of the constants whose trajectories are nearest to what records have measured."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.identified_law import AS_THEY_ARE
from stickslip_ros.identification.refinement import Refinement
from stickslip_ros.identification.segment_starts import ROUGH_TOLERANCE
from stickslip_ros.identification.time_limit import OutOfTimeError
from stickslip_ros.identification.trajectories import Trajectories

_BOUND_DISTANCE = 1e-9
"""Distance of the start of a search from its bounds, as a share of the value."""
_STEP = 1e-6
"""Step of the differences of coordinates, as a share of the value."""
_WORSE_LOSS_RATIO = 4.0
"""Squared error from predicted starts, in that of the best point, from which the starts of that
are tried, too."""


def refine(
    task: Trajectories,
    free: Sequence[str],
    values: Mapping[str, float],
    starts: FloatArray | None = None,
    *,
    most: int = 30,
) -> Refinement:
    """Fit the coordinates in `free`, if any, and the states at the starts of the segments.

    The starts follow the coordinates (variable projection, G. H. Golub, V. Pereyra, The
    differentiation of pseudo-inverses and nonlinear least squares problems whose variables
    separate, SIAM Journal on Numerical Analysis 10(2), 1973). The search begins at all coordinates
    in `values` and at states of shape (segments, 2), by default the measured ones; it takes `most`
    steps at most, and ends at the best ones so far when the time of the task is over.
    """
    from scipy.optimize import least_squares

    search = _Search(task, free, values, task.starts if starts is None else starts)
    point = search.best[0]
    if len(free):
        solve: Any = least_squares  # its types know no function for jac
        try:
            point = solve(
                search.residual,
                point,
                search.derivatives,
                bounds=search.bounds,
                x_scale="jac",
                ftol=1e-7,
                xtol=1e-8,
                gtol=1e-12,
                max_nfev=most,
            ).x
        except OutOfTimeError:
            point = search.best[0]
    return search.at(point).settled()


class _Search:
    """The errors at the best starts, as a function of a point: the coordinates of the search."""

    def __init__(
        self,
        task: Trajectories,
        free: Sequence[str],
        values: Mapping[str, float],
        starts: FloatArray,
    ) -> None:
        law, fastest = task.law, task.fastest
        self._task, self._free, self._values = task, free, values
        self._scale = 1.0 / (1e-3 * float(np.ptp(task.positions)))
        straight = law.straightening
        if not {*straight.names, *straight.with_free} <= {*free}:
            straight = AS_THEY_ARE
        self._straight, self._names = straight, [straight.names.get(name, name) for name in free]
        to_search = {**values, **straight.to_search(values, fastest)}
        first = np.array([to_search[name] for name in self._names])
        bounds = [
            straight.bounds.get(searched) or law.bounds(name, values, fastest)
            for name, searched in zip(free, self._names, strict=True)
        ]
        self.bounds = np.array(bounds, float).reshape(-1, 2).T
        """Smallest and largest values of a point, shape (2, coordinates)."""
        # No more than a part of narrow bounds that the start is far away from.
        least = np.minimum(_BOUND_DISTANCE * np.abs(first), 0.25 * np.ptp(self.bounds, axis=0))
        first = np.clip(first, self.bounds[0] + least, self.bounds[1] - least)
        begun = Refinement.at(task, free, self._coordinates(first), starts)
        self.best = self._last = first, begun.settled(ROUGH_TOLERANCE)
        """The best point so far, with its errors."""

    def residual(self, point: FloatArray) -> FloatArray:
        """Return the errors at a point, at starts that are best to first order."""
        errors = self.at(point)
        if self._task.limit.is_over:
            raise OutOfTimeError
        return errors.without_starts(errors.residual[:, None])[:, 0] * self._scale

    def derivatives(self, point: FloatArray) -> FloatArray:
        """Return the derivatives of the errors at a point, at starts that follow it."""
        errors = self.at(point)
        return errors.without_starts(errors.by_names) @ self._by_point(point) * self._scale

    def at(self, point: FloatArray) -> Refinement:
        """Return the errors at a point, at starts that are nearly the best ones."""
        for known, errors in (self._last, self.best):
            if np.array_equal(known, point):
                return errors
        before, best = self.best
        change = best.by_names @ self._by_point(before) @ (point - before)
        values = self._coordinates(point)
        errors = Refinement.at(self._task, self._free, values, best.starts - best.steps(change))
        if errors.loss > _WORSE_LOSS_RATIO * best.loss:
            errors = min(errors, errors.moved(best.starts), key=lambda attempt: attempt.loss)
        self._last = point.copy(), errors.settled(ROUGH_TOLERANCE)
        self.best = min(self.best, self._last, key=lambda attempt: attempt[1].loss)
        return self._last[1]

    def _coordinates(self, point: FloatArray) -> dict[str, float]:
        """Return all coordinates at a point."""
        values = {**self._values, **dict(zip(self._names, point.tolist(), strict=True))}
        values |= self._straight.from_search(values, self._task.fastest)
        return {name: values[name] for name in self._values}

    def _by_point(self, point: FloatArray) -> FloatArray:
        """Return the derivatives of the coordinates by those of the search."""
        if self._straight is AS_THEY_ARE:
            return np.eye(len(point))
        from scipy.optimize import approx_fprime

        def coordinates(point: FloatArray) -> FloatArray:
            moved = self._coordinates(point)
            return np.array([moved[name] for name in self._free])

        steps = _STEP * np.maximum(np.abs(point), 1e-12)
        derivatives: Any = approx_fprime(point, coordinates, steps)
        return derivatives
