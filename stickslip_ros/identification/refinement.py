"""Fit of the simulated trajectory, through stick and slip, to what records have measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.identification.filtered import filtered
from stickslip_ros.identification.fit import (
    CURVE_POINTS,
    Fit,
    ForceErrors,
    Residuals,
    block_covariance,
)
from stickslip_ros.identification.laws import DELAY, LAG, IdentifiedLaw
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.time_limit import OutOfTimeError
from stickslip_ros.identification.trajectories import Trajectories, segments_of
from stickslip_ros.identification.trajectory import Predictor

_OWN_SHARE = 1e-5
"""Least share of a derivative beside the others, for a coordinate that is identifiable."""
_BOUND_DISTANCE = 1e-9
"""Distance of the start of a search from its bounds, as a share of the value."""
_STEP = 1e-6
"""Step of the differences of coordinates, as a share of the value."""
_RANK = 1e-9
"""Share of the largest singular value below which the start of a segment is not identifiable."""
_ROUGH_TOLERANCE, _FINAL_TOLERANCE = 0.03, 1e-6
"""Starts are good enough if better ones would lower the squared error by less than this share:
while the constants change, and at their end."""
_SHORTEST_STEP = 1e-3
"""A start whose steps are shortened below this share of a full one is not changed further."""
_START_STEPS = 8
"""Largest number of steps of the starts for one set of constants."""
_OUTLIER_LOSS_RATIO = 9.0
"""The start of a segment is doubted if its squared error is larger than that of the median one by
this factor."""
_SHORTEST_CYCLE, _REPEATED_CORRELATION = 20, 0.65
"""Samples of a cycle at least, and correlation of errors from which cycles are alike."""
_UNLIKE_CORRELATION = 0.3
"""Correlation below which errors have become unlike before they repeat."""
_KICKS = (0.0, 0.5, -0.5, 2.0, -2.0)
"""Changes of the velocity at such a start, in errors of position per period."""


class _Errors(NamedTuple):
    """Weighted errors of a fit with their derivatives."""

    starts: FloatArray
    """State at the start of each segment; shape (segments, 2)."""
    residual: FloatArray
    """Predicted less measured outputs, m."""
    by_names: FloatArray
    """Derivatives by coordinates; shape (rows, coordinates)."""
    by_start: FloatArray
    """Derivatives by the start of the own segment; shape (rows, 2)."""

    @property
    def loss(self) -> float:
        """Sum of the squared errors, m^2."""
        return float(self.residual @ self.residual)


@dataclass(frozen=True, eq=False)
class Refinement(Fit):
    """The constants whose trajectories are nearest to the measured positions."""

    has_spring = True
    task: Trajectories
    free: Sequence[str]
    """Coordinates that are fitted."""
    values: Mapping[str, float]
    """All coordinates."""
    starts: FloatArray
    """Fitted state at the start of each segment, m and m/s; shape (segments, 2)."""
    residual: FloatArray
    """Predicted less measured outputs, weighted, m."""
    by_start: FloatArray
    """Derivatives of the residual by the start of the own segment; shape (rows, 2)."""
    derivatives: FloatArray
    """Derivatives of the residual by `free`, at starts that follow them; shape (rows, free)."""

    @property
    @override
    def law(self) -> IdentifiedLaw:
        return self.task.law

    @property
    @override
    def directions(self) -> Sequence[float]:
        return self.task.directions

    @property
    @override
    def delay(self) -> float:
        return self.values.get(DELAY, 0.0)

    @property
    @override
    def scale(self) -> float:
        return float(np.std(self.task.positions))

    @property
    @override
    def point(self) -> FloatArray:
        return np.array([self.values[name] for name in self.free])

    @override
    def linearized(self) -> tuple[FloatArray, FloatArray, int]:
        return self.derivatives, self.residual, self._lost

    @override
    def values_at(self, point: FloatArray) -> Mapping[str, float]:
        return {**self.values, **dict(zip(self.free, point.tolist(), strict=True))}

    @override
    def force_at(self, point: FloatArray, sign: float, speed: FloatArray) -> FloatArray:
        law = self.law.friction(self.values_at(point), 1.0)
        return np.array([-sign * float(law.coefficient(sign * w, sign)) for w in speed.tolist()])

    @override
    def curve_speeds(self, fastest: float) -> FloatArray:
        return np.linspace(0.0, fastest, CURVE_POINTS)

    @override
    def errors(self, record: Record) -> ForceErrors:
        record = record.lagging(self.values.get(LAG, 0.0))
        columns = filtered(record, decimated=False, delay=self.delay)
        time, position, velocity, acceleration, speed, force = (
            each[columns.settled]
            for each in (
                columns.time,
                columns.position,
                columns.velocity,
                columns.acceleration,
                columns.relative_speed,
                columns.force,
            )
        )
        values, law = self.values, self.law.friction(self.values, 1.0)
        friction = np.array(
            [float(law.coefficient(each, 1.0 if each > 0.0 else -1.0)) for each in speed]
        )
        model = values["mass"] * acceleration - friction - values["bias_force"]
        model += values["damping"] * velocity + values["stiffness"] * position
        return ForceErrors(time, position, speed, force - model, force - model - friction, force)

    @override
    def free_run(self, record: Record) -> FloatArray:
        task = self._divided(record, record.duration)
        count = task.segments[0].count
        run = task.predicted(self.values, refine(task, (), self.values).starts)[:count]
        return np.concatenate([np.full(len(record.position) - len(run), np.nan), run])

    @override
    def residuals(self, record: Record) -> Residuals:
        from scipy.signal import savgol_filter

        length = float(np.median([segment.count for segment in self.task.segments]))
        task = self._divided(record, length * self.task.predictors[0].record.period)
        task = replace(task, predictors=[Predictor(replace(record, velocity=None))])
        starts = restarted(refine(task, (), self.values)).starts
        away = task.positions - task.predicted(self.values, starts)
        rows = np.concatenate([np.arange(s.start, s.start + s.count) for s in task.segments])
        measured = ~record.lost[rows]
        away, rows = away[measured], rows[measured]
        speed: FloatArray = np.asarray(
            savgol_filter(record.position, 11, 3, deriv=1, delta=record.period)
        )
        relative = (speed - record.belt_velocity)[rows]
        time = record.period * rows.astype(float)
        return Residuals(time, record.position[rows], relative, away)

    def _divided(self, record: Record, length: float) -> Trajectories:
        """Return the task of predicting a record in segments of a length, s."""
        segments, starts = segments_of([record], length)
        return replace(self.task, predictors=[Predictor(record)], segments=segments, starts=starts)

    @property
    def losses(self) -> FloatArray:
        """Mean square of the weighted errors in each segment, m^2."""
        block, weight = self.task.block, self.task.weight
        squares = self.residual * self.residual
        return np.bincount(block, squares) / np.bincount(block, weight * weight)

    @property
    def has_outliers(self) -> bool:
        """Whether most of the error is that of a few segments: their starts may be wrong."""
        losses = self.losses
        worse = losses > _OUTLIER_LOSS_RATIO * np.median(losses)
        return float(losses[worse].sum()) > 0.5 * float(losses.sum())

    @property
    def correlation(self) -> float:
        """Correlation of successive errors."""
        first, second = self.residual[:-1], self.residual[1:]
        power = float(self.residual @ self.residual)
        return float(first @ second) / power if power > 0.0 else 0.0

    @property
    @override
    def used(self) -> float:
        samples = sum(segment.count for segment in self.task.segments)
        return samples / sum(len(each.record.position) for each in self.task.predictors)

    @property
    @override
    def repetition(self) -> int | None:
        return repetition_of(self.residual[self.task.of_positions])

    @property
    def _lost(self) -> int:
        """Number of values at the starts that were fitted besides."""
        return 2 * len(self.starts)

    def gain(self, name: str) -> tuple[float, float]:
        """Return what fitting one more coordinate would bring, to first order.

        It is the number of standard errors by which the coordinate would move, and the share of the
        square of the residual that would go; 0 for what the record cannot tell.
        """
        column = self.task.sensitivities(self.values, self.starts, [name]).by_names
        column = self.task.weight[:, None] * column
        others = self.derivatives
        norms = np.linalg.norm(others, axis=0)
        basis = np.linalg.qr(others / np.where(norms > 0.0, norms, 1.0))[0]
        alone = _without_starts(self.task, self.by_start, column)[:, 0]
        alone -= basis @ (basis.T @ alone)
        size = float(alone @ alone)
        if size <= (_OWN_SHARE * float(np.linalg.norm(column))) ** 2:
            return 0.0, 0.0
        rest = self.residual - basis @ (basis.T @ self.residual)
        error = np.sqrt(block_covariance(alone[:, None], rest, self._lost)[0, 0])
        along = float(alone @ rest)
        return -along / size / float(error), along * along / size / float(rest @ rest)


def repetition_of(errors: FloatArray) -> int | None:
    """Return the number of samples after which errors repeat; None if they do not.

    Errors that are coloured only are alike over few samples, and less and less: their correlation
    falls, and does not rise again.
    """
    from scipy.signal import correlate

    found = correlate(errors, errors, method="fft")[len(errors) - 1 :][: len(errors) // 4]
    if not len(found) or not found[0] > 0.0:
        return None
    shares = found / found[0]
    unlike = np.flatnonzero(shares < _UNLIKE_CORRELATION)
    if not len(unlike):
        return None
    start = max(_SHORTEST_CYCLE, int(unlike[0]))
    later = shares[start:]
    peaks = np.flatnonzero((later[1:-1] >= later[:-2]) & (later[1:-1] >= later[2:])) + 1
    if not len(peaks) or float(later[peaks].max()) < _REPEATED_CORRELATION:
        return None
    return int(peaks[np.argmax(later[peaks])]) + start


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

    fit = _Projection(task, free, values, task.starts if starts is None else starts)
    best = fit.first
    if len(free):
        bounds = fit.bounds()
        # No more than a part of narrow bounds that the start is far away from.
        least = np.minimum(_BOUND_DISTANCE * np.abs(best), 0.25 * (bounds[1] - bounds[0]))
        inside = least * np.array([[1.0], [-1.0]])
        solve: Any = least_squares  # its types know no function for jac
        try:
            best = solve(
                fit.residual,
                np.clip(best, *(bounds + inside)),
                fit.derivatives,
                bounds=bounds,
                x_scale="jac",
                ftol=1e-7,
                xtol=1e-8,
                gtol=1e-12,
                max_nfev=most,
            ).x
        except OutOfTimeError:
            best = fit.best
    return fit.refinement(best, fit.finished(best))


def restarted(fit: Refinement) -> Refinement:
    """Return a fit whose segments that fit much worse than others have tried other starts."""
    if not fit.has_outliers:
        return fit
    own = _Projection(fit.task, fit.free, fit.values, fit.starts)
    return own.refinement(own.first, own.kicked(own.first))


class _Projection:
    """The errors of a model at the best starts, as a function of its coordinates."""

    def __init__(
        self,
        task: Trajectories,
        free: Sequence[str],
        values: Mapping[str, float],
        starts: FloatArray,
    ) -> None:
        self._task, self._free, self._values = task, free, values
        self._scale = 1.0 / (1e-3 * float(np.ptp(task.positions)))
        self._point: FloatArray | None = None
        self._best: _Errors | None = None
        self._last: tuple[bytes, _Errors] | None = None
        self._starts = starts
        self._straight = task.law.straightened if {*task.law.straightened} <= {*free} else {}
        to_search = task.law.to_search(values, task.fastest) if self._straight else values
        self.first = np.array([to_search[name] for name in free])
        """The point of the coordinates at the start of the search."""

    @property
    def best(self) -> FloatArray:
        """The best point so far."""
        return self.first if self._point is None else self._point

    def refinement(self, point: FloatArray, found: _Errors) -> Refinement:
        """Return the errors at a point as a fit."""
        return Refinement(
            self._task,
            self._free,
            self.values(point),
            found.starts,
            found.residual,
            found.by_start,
            _without_starts(self._task, found.by_start, found.by_names),
        )

    def bounds(self) -> FloatArray:
        """Return the smallest and the largest values of a point, shape (2, coordinates)."""
        law, fastest = self._task.law, self._task.fastest
        return np.transpose(
            [
                self._straight.get(name) or law.bounds(name, self._values, fastest)
                for name in self._free
            ]
        )

    def values(self, point: FloatArray) -> dict[str, float]:
        """Return all coordinates at a point."""
        found = {**self._values, **dict(zip(self._free, point.tolist(), strict=True))}
        return self._task.law.from_search(found, self._task.fastest) if self._straight else found

    def _of_search(self, point: FloatArray) -> FloatArray:
        """Return the derivatives of the coordinates by those of the search."""
        if not self._straight:
            return np.eye(len(point))
        base, columns = self.values(point), list[list[float]]()
        for number in range(len(point)):
            step = _STEP * max(abs(float(point[number])), 1e-12)
            moved = point.copy()
            moved[number] += step
            other = self.values(moved)
            columns.append([(other[each] - base[each]) / step for each in self._free])
        return np.transpose(columns)

    def residual(self, point: FloatArray) -> FloatArray:
        """Return the errors at a point, at starts that are best to first order."""
        found = self.at(point)
        if self._task.limit.is_over:
            raise OutOfTimeError
        rest = _without_starts(self._task, found.by_start, found.residual[:, None])
        return rest[:, 0] * self._scale

    def derivatives(self, point: FloatArray) -> FloatArray:
        """Return the derivatives of the errors at a point, at starts that follow it."""
        found = self.at(point)
        columns = _without_starts(self._task, found.by_start, found.by_names)
        return columns @ self._of_search(point) * self._scale

    def at(self, point: FloatArray) -> _Errors:
        """Return the errors at a point, at starts that are nearly the best ones."""
        key = point.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1]
        if self._best is not None and self._point is not None and key == self._point.tobytes():
            return self._best
        found = self._settled(point)
        self._last = key, found
        if self._best is None or found.loss < self._best.loss:
            self._best, self._point = found, point.copy()
        return found

    def _settled(self, point: FloatArray) -> _Errors:
        starts = self._starts
        if self._best is not None and self._point is not None:
            change = self._best.by_names @ self._of_search(self._point) @ (point - self._point)
            starts = self._best.starts - _steps(self._task, self._best.by_start, change)
        found = self._errors(point, starts)
        if self._best is not None and found.loss > 4.0 * self._best.loss:
            kept = self._errors(point, self._best.starts)
            found = min(found, kept, key=lambda each: each.loss)
        return self._improved(point, found, _ROUGH_TOLERANCE)

    def finished(self, point: FloatArray) -> _Errors:
        """Return the errors at a point, at the best starts."""
        return self._improved(point, self.at(point), _FINAL_TOLERANCE)

    def kicked(self, point: FloatArray) -> _Errors:
        """Return the errors at a point, at the best starts that kicks of the measured ones give."""
        found = self.finished(point)
        means = self._losses(found.residual) / self._losses(self._task.weight)
        rough = np.sqrt(np.median(means)) / self._task.predictors[0].record.period
        for kick in _KICKS:
            starts = self._task.starts + np.array([0.0, kick * rough])
            other = self._improved(point, self._errors(point, starts), _FINAL_TOLERANCE)
            found, _ = self._better(found, other)
        return found

    def _better(self, one: _Errors, other: _Errors) -> tuple[_Errors, BoolArray]:
        """Return the better one of two fits of each segment, and for which it is the other one."""
        better = self._losses(other.residual) < self._losses(one.residual)
        rows = better[self._task.block]
        return _Errors(
            np.where(better[:, None], other.starts, one.starts),
            np.where(rows, other.residual, one.residual),
            np.where(rows[:, None], other.by_names, one.by_names),
            np.where(rows[:, None], other.by_start, one.by_start),
        ), better

    def _improved(self, point: FloatArray, found: _Errors, tolerance: float) -> _Errors:
        """Return the errors at starts that are best up to a share of the squared error.

        The start of a segment has no part in the others: each takes steps of its own length.
        """
        parts = self._task.parts
        share = np.ones(len(parts))
        for _ in range(_START_STEPS):
            squares = self._losses(found.residual)
            left = self._losses(
                _without_starts(self._task, found.by_start, found.residual[:, None])[:, 0]
            )
            if (
                float(np.sum((squares - left) * (share >= _SHORTEST_STEP)))
                <= tolerance * found.loss
            ):
                break
            steps = share[:, None] * _steps(self._task, found.by_start, found.residual)
            other = self._errors(point, found.starts - steps)
            found, better = self._better(found, other)
            share = np.where(better, np.minimum(2.0 * share, 1.0), 0.25 * share)
        return found

    def _losses(self, residual: FloatArray) -> FloatArray:
        return np.bincount(self._task.block, residual * residual).astype(float)

    def _errors(self, point: FloatArray, starts: FloatArray) -> _Errors:
        task, weight = self._task, self._task.weight
        outputs, by_names, by_start = task.sensitivities(self.values(point), starts, self._free)
        return _Errors(
            starts,
            weight * (outputs - task.measured),
            weight[:, None] * by_names,
            weight[:, None] * by_start,
        )


def _decomposed(by_start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an orthogonal basis of the columns, and their pseudo-inverse by that basis."""
    norms = np.linalg.norm(by_start, axis=0)
    norms[norms == 0.0] = 1.0
    left, sizes, right = np.linalg.svd(by_start / norms, full_matrices=False)
    kept = sizes > _RANK * max(float(sizes[0]), 1e-300)
    return left[:, kept], (right[kept].T / sizes[kept]) / norms[:, None]


def _without_starts(task: Trajectories, by_start: FloatArray, columns: FloatArray) -> FloatArray:
    """Return the part of columns that no change of the starts explains."""
    found = np.array(columns)
    for part in task.parts:
        basis, _ = _decomposed(by_start[part])
        found[part] -= basis @ (basis.T @ found[part])
    return found


def _steps(task: Trajectories, by_start: FloatArray, column: FloatArray) -> FloatArray:
    """Return the changes of the starts that explain a column best; shape (segments, 2)."""
    found = np.zeros((len(task.parts), 2))
    for number, part in enumerate(task.parts):
        basis, inverse = _decomposed(by_start[part])
        found[number] = inverse @ (basis.T @ column[part])
    return found
