"""Fits of a drive to records: their covariances, and the choice by what they predict."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import copysign, inf, sqrt
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.identification.adapters import DirectionalAdapter
from stickslip_ros.identification.laws import DELAY, IdentifiedLaw
from stickslip_ros.identification.record import Record
from stickslip_ros.physics.model.drive import Drive

_STEP = 1e-5
"""Step of differences, as a share of the value."""
_NEAR_ZERO = 1e-6
"""Standard errors below which a value is nearly zero."""
BLOCKS = 24
"""Number of blocks of time from whose scatter covariances are computed."""
QUANTILE = 2.07
"""Half of a 95 % interval, in standard errors: Student's t with BLOCKS - 1 = 23 degrees of
freedom."""
_RANK = 1e-13
"""Share of the largest eigenvalue below which rows do not tell a combination of parameters."""
_PART = 1e-6
"""Part in such a combination from which a parameter is not identifiable; less is rounding error."""
CURVE_POINTS = 40
"""Points that stand for a curve."""
_SIGNIFICANT = 3.0
"""Standard errors by which a model must predict better to be preferred to a simpler one."""
_LEAST_GAIN = 0.01
"""Share of the error by which it must be better besides."""


@dataclass(frozen=True)
class Estimate:
    """A fitted constant."""

    value: float
    """Value, SI units."""
    standard_error: float
    """Standard error, SI units."""

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        half = QUANTILE * self.standard_error
        return self.value - half, self.value + half

    def as_dict(self) -> dict[str, Any]:
        """Return value, `standard_error` and `interval` by name, for JSON."""
        own = {"value": self.value, "standard_error": self.standard_error}
        return {**own, "interval": [*self.interval]}


@dataclass(frozen=True, eq=False)
class Friction:
    """A friction curve with its band, in one direction; arrays of shape (points,)."""

    speed: FloatArray
    """Speed |v_r|, m/s, within what was recorded."""
    force: FloatArray
    """Friction force, N."""
    standard_error: FloatArray
    """Standard error of the force, N."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Errors that a model leaves in its record, arrays of shape (rows,)."""

    time: FloatArray
    """Time from the first sample, s."""
    position: FloatArray
    """Displacement, m."""
    relative_speed: FloatArray
    """Velocity less that of the belt, m/s."""
    error: FloatArray
    """Measured less modelled force of an axis, N; position of a drive on a spring, m."""


@dataclass(frozen=True, eq=False)
class ForceErrors(Residuals):
    """Measured and modelled forces on filtered rows; the error is one of forces, N."""

    friction: FloatArray
    """Size of the measured friction with the sign of the slip: what the other forces leave, N."""
    force: FloatArray
    """Known force, N."""


class Fit(ABC):
    """A drive fitted to records: by a regression of forces, or by its trajectories."""

    has_spring: ClassVar[bool]
    """Whether the drive has a spring."""
    least_gain: ClassVar[float] = 0.0
    """Difference of validation errors that tells nothing of the laws."""

    @property
    @abstractmethod
    def law(self) -> IdentifiedLaw:
        """Friction law, by direction if it differs between them."""

    @property
    @abstractmethod
    def directions(self) -> Sequence[float]:
        """Signs of the relative speed that were recorded: 1, -1 or both."""

    @property
    @abstractmethod
    def delay(self) -> float | None:
        """Time from a sample until its force acts, s; None if nothing asks for one."""

    @property
    @abstractmethod
    def scale(self) -> float:
        """Root mean square of what is predicted, N or m."""

    @property
    @abstractmethod
    def point(self) -> FloatArray:
        """Fitted numbers."""

    @abstractmethod
    def linearized(self) -> tuple[FloatArray, FloatArray, int]:
        """Return the derivatives of the errors by the point, the errors, and what else is fitted.

        The derivatives have the shape (rows, numbers); the last is a number of further values.
        """

    @abstractmethod
    def values_at(self, point: FloatArray) -> Mapping[str, float]:
        """Return the coordinates of the drive at another point, SI units."""

    @abstractmethod
    def force_at(self, point: FloatArray, sign: float, speed: FloatArray) -> FloatArray:
        """Return the size of steady friction at another point, N, at speeds |v_r|, m/s."""

    @abstractmethod
    def curve_speeds(self, fastest: float) -> FloatArray:
        """Return the speeds of the points that stand for a curve, m/s."""

    @abstractmethod
    def errors(self, record: Record) -> ForceErrors:
        """Return measured and modelled forces on the filtered rows of a record where it slips."""

    @abstractmethod
    def residuals(self, record: Record) -> Residuals:
        """Return what the fit leaves of a record; see `Findings.residuals`."""

    @abstractmethod
    def free_run(self, record: Record) -> FloatArray:
        """Return the positions in a run through a whole record, m; see `Findings.free_run`."""

    @property
    def used(self) -> float:
        """Share of the samples of the records that were used."""
        return 1.0

    @property
    def repetition(self) -> int | None:
        """Number of samples after which the errors of position repeat; None if they do not."""
        return None

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the point, from the scatter over blocks of time."""
        return block_covariance(*self.linearized())

    def drive(self, normal_force: float, belt_speed: float = 0.0) -> Drive:
        """Return the drive."""
        return self.law.drive(self.values_at(self.point), normal_force, belt_speed)

    def parameters(self, normal_force: float) -> tuple[list[str], FloatArray, FloatArray]:
        """Return names, values and covariance of the fitted parameters of the plant."""

        def found(point: FloatArray) -> dict[str, float]:
            values = self.values_at(point)
            own = self.law.constants(values, normal_force)
            own[DELAY] = values.get(DELAY, 0.0)
            return own

        values, linear = self._linear(lambda point: np.array([*found(point).values()]))
        fitted = np.abs(linear).sum(axis=1) > 0.0
        names = [name for name, used in zip(found(self.point), fitted, strict=True) if used]
        return names, values[fitted], propagated(linear[fitted], self.covariance)

    def friction(self, sign: float, fastest: float) -> Friction:
        """Return the friction curve in one of `directions`.

        It is that from rest to the fastest recorded speed |v_r|, m/s.
        """
        speed = self.curve_speeds(fastest)
        force, linear = self._linear(lambda point: self.force_at(point, sign, speed))
        variance = np.diag(propagated(linear, self.covariance))
        return Friction(speed, force, np.sqrt(np.maximum(variance, 0.0)))

    def _linear(
        self, function: Callable[[FloatArray], FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the values of a function of the point, and their derivatives by it."""
        point, base = self.point, function(self.point)
        errors = np.sqrt(np.diag(self.covariance))
        sizes = np.abs(point)
        # Of a number that is nearly zero its error is the size.
        sizes = np.where((sizes < _NEAR_ZERO * errors) & np.isfinite(errors), errors, sizes)
        linear = np.zeros((len(base), len(point)))
        for number, step in enumerate((_STEP * np.maximum(sizes, 1e-9)).tolist()):
            moved = point.copy()
            moved[number] += step
            linear[:, number] = (function(moved) - base) / step
        return base, linear


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted model with what it predicts of parts that it was not fitted to."""

    fit: Fit
    """The fit."""
    held_out: FloatArray
    """Mean square of the error in each held-out part, N^2 of forces or m^2 of positions."""
    remark: str = ""
    """Restriction of the model, or reason why it is out of the choice."""

    @property
    def law(self) -> str:
        """Friction law."""
        return self.fit.law.name

    @property
    def size(self) -> int:
        """Number of fitted constants."""
        return len(self.fit.point) + (self.fit.law.deflection > 0.0)

    @property
    def by_direction(self) -> bool:
        """Whether a law on a spring has constants of its own in each direction."""
        return self.fit.has_spring and isinstance(self.fit.law, DirectionalAdapter)

    @property
    def label(self) -> str:
        """Name of the law, and whether it is by direction."""
        return f"{self.law} by direction" if self.by_direction else self.law

    @property
    def error(self) -> float:
        """Validation error: rms of what is held out, as a share of the scale."""
        known = len(self.held_out) and self.fit.scale > 0.0
        return sqrt(float(np.mean(self.held_out))) / self.fit.scale if known else inf


def better_by(better: Candidate, worse: Candidate) -> float:
    """Return by how many standard errors one model predicts better than the other.

    Less than one per cent, or than `Fit.least_gain`, counts as nothing. It compares the logarithms
    of the errors part by part: a single bad part decides nothing. Models that were not compared on
    the same parts are told apart by their errors alone.
    """
    if len(better.held_out) != len(worse.held_out):
        return copysign(inf, worse.error - better.error)
    if worse.error < (1.0 + _LEAST_GAIN) * better.error + better.fit.least_gain:
        return 0.0
    tiny = np.finfo(float).tiny
    ratios = np.log(np.maximum(worse.held_out, tiny) / np.maximum(better.held_out, tiny))
    mean, count = float(np.mean(ratios)), len(ratios)
    error = float(np.std(ratios, ddof=1)) / sqrt(count) if count > 1 else 0.0
    return mean / error if error > 0.0 else copysign(inf, mean) if mean else 0.0


def choose(candidates: Sequence[Candidate]) -> tuple[Candidate, Mapping[str, bool]]:
    """Return the simplest model that predicts as well as any, and which others do, by label.

    A model is as good as the best one if the difference of their validation errors is within three
    standard errors, from its scatter over the parts, or if it is simpler and better than such a
    one. A model with constants that the records do not tell is chosen only if all have some.
    """
    best = min(candidates, key=lambda each: each.error)
    near = [each for each in candidates if each is best or better_by(best, each) < _SIGNIFICANT]
    # An error that scatters much is within it, too: what is simpler and better is as good as that.
    as_good = [
        each
        for each in candidates
        if any(each.size <= other.size and each.error <= other.error for other in near)
    ]
    told = [each for each in as_good if np.isfinite(np.diag(each.fit.covariance)).all()]
    chosen = min(told or as_good, key=lambda each: (each.size, each.error))
    return chosen, {each.label: each in as_good for each in candidates}


def block_covariance(jacobian: FloatArray, residual: FloatArray, lost: int = 0) -> FloatArray:
    """Return the covariance of a least-squares fit to a series whose errors may be coloured.

    It is the jackknife over blocks of time, to first order (A. C. Cameron, D. L. Miller, A
    practitioner's guide to cluster-robust inference, Journal of Human Resources 50(2), 2015):
    errors may be correlated within a block. No variance is below that with independent errors. The
    jacobian has the shape (rows, parameters), its rows follow one another in time; `lost` further
    values were fitted. The variance of what the rows do not tell is infinite, its covariances are
    0; see `propagated`.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = jacobian / scale
    product = scaled.T @ scaled
    untold = _untold(product)
    changes: list[FloatArray] = []
    for rows in np.array_split(np.arange(len(residual)), BLOCKS):
        own = scaled[rows]
        rest = np.linalg.pinv(product - own.T @ own, rcond=_RANK, hermitian=True)
        changes.append(rest @ (own.T @ residual[rows]))
    away = np.array(changes) - np.mean(changes, axis=0)
    found = (away.T @ away) * (BLOCKS - 1) / BLOCKS
    freedom = max(len(residual) - jacobian.shape[1] - lost, 1)
    white = np.linalg.pinv(product, rcond=_RANK, hermitian=True)
    white *= float(residual @ residual) / freedom
    tiny = np.finfo(float).tiny
    ratios = np.maximum(np.diag(white), tiny) / np.maximum(np.diag(found), tiny)
    larger = np.sqrt(np.maximum(ratios, 1.0))
    found = found * np.outer(larger / scale, larger / scale)
    found[untold, :] = found[:, untold] = 0.0
    found[untold, untold] = np.inf
    return found


def _untold(product: FloatArray) -> BoolArray:
    """Return which parameters have a part in a combination that rows do not tell."""
    if not len(product):
        return np.zeros(0, bool)
    sizes, axes = np.linalg.eigh(product)
    lost = sizes <= _RANK * max(float(sizes[-1]), np.finfo(float).tiny)
    return np.any(np.abs(axes[:, lost]) > _PART, axis=1)


def propagated(linear: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance of results that depend linearly on values with a covariance.

    `linear` has the derivatives of the results, shape (results, values). The variance of what
    depends on a value with an infinite variance is infinite.
    """
    told = np.isfinite(np.diag(covariance))
    own = linear[:, told]
    found = own @ covariance[np.ix_(told, told)] @ own.T
    untold = (linear[:, ~told] != 0.0).any(axis=1)
    found[untold, :] = found[:, untold] = 0.0
    found[untold, untold] = np.inf
    return found
