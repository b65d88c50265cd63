"""What a fit of a drive to records tells: constants with intervals, and friction curves."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, sqrt
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.covariance import block_covariance, propagated
from stickslip_ros.identification.identified_law import DELAY, IdentifiedLaw, label_of
from stickslip_ros.identification.record import Record
from stickslip_ros.model.drive import Drive

_STEP = 1e-5
"""Step of differences, as a share of the value."""
_NEAR_ZERO = 1e-6
"""Standard errors below which a value is nearly zero."""
QUANTILE = 2.07
"""Half of a 95 % interval, in standard errors: Student's t with BLOCKS - 1 = 23 degrees of
freedom."""
OUT_OF_TIME = "the time was over before it was fitted to the end"
"""Remark of a fit whose constants are on their way: nothing is known of their errors."""
CURVE_POINTS = 40
"""Points that stand for a curve."""


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
        entries = {"value": self.value, "standard_error": self.standard_error}
        return {**entries, "interval": [*self.interval]}


@dataclass(frozen=True, eq=False)
class Friction:
    """A friction curve with its band, in one direction; arrays of shape (points,)."""

    direction: float
    """Sign of the relative speed."""
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


@dataclass(frozen=True, eq=False)
class Fit(ABC):
    """A drive fitted to records: by a regression of forces, or by its trajectories."""

    held_out: FloatArray = field(default_factory=lambda: np.empty(0), kw_only=True)
    """Mean square of the error in each part that was held out, N^2 of forces or m^2 of positions;
    empty if none was."""
    remark: str = field(default="", kw_only=True)
    """Restriction of the model, or reason why it is out of the choice of a law."""
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

    def curve_speeds(self, fastest: float) -> FloatArray:
        """Return the speeds of the points that stand for a curve, m/s."""
        return np.linspace(0.0, fastest, CURVE_POINTS)

    @abstractmethod
    def errors(self, record: Record) -> ForceErrors:
        """Return measured and modelled forces on the filtered rows of a record where it slips."""

    def residuals(self, record: Record) -> Residuals:
        """Return what the fit leaves of a record; see `Findings.residuals`."""
        return self.errors(record)

    @abstractmethod
    def free_run(self, record: Record) -> FloatArray:
        """Return the positions in a run through a whole record, m; see `Findings.free_run`."""

    @property
    def delay(self) -> float:
        """Time from a sample until its force acts, s."""
        return self.values_at(self.point)[DELAY]

    @property
    def size(self) -> int:
        """Number of fitted constants."""
        return len(self.point) + (self.law.one_way.deflection > 0.0)

    @property
    def by_direction(self) -> bool:
        """Whether a law on a spring has constants of its own in each direction."""
        return self.has_spring and self.law.one_way is not self.law

    @property
    def label(self) -> str:
        """Name of the law, and whether it is by direction."""
        return label_of(self.law) if self.has_spring else self.law.name

    @property
    def error(self) -> float:
        """Validation error: rms of what is held out, as a share of the scale."""
        known = len(self.held_out) and self.scale > 0.0
        return sqrt(float(np.mean(self.held_out))) / self.scale if known else inf

    def used(self, records: Sequence[Record]) -> float:
        """Return the share of the samples that were used of the records it was fitted to."""
        return 1.0

    @property
    def doubt(self) -> str:
        """Why the law is not that of the records, as far as they tell; empty: it may be."""
        return ""

    @property
    def repetition(self) -> int | None:
        """Number of samples after which the errors of position repeat; None if they do not."""
        return None

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the point, from the scatter over blocks of time."""
        if self.remark == OUT_OF_TIME:
            return np.diag(np.full(len(self.point), inf))
        return block_covariance(*self.linearized())

    def drive(self, normal_force: float, belt_speed: float = 0.0) -> Drive:
        """Return the drive."""
        return self.law.drive(self.values_at(self.point), normal_force, belt_speed)

    def parameters(self, normal_force: float) -> tuple[list[str], FloatArray, FloatArray]:
        """Return names, values and covariance of the fitted parameters of the plant."""

        def constants(point: FloatArray) -> dict[str, float]:
            values = self.values_at(point)
            return self.law.constants(values, normal_force) | {DELAY: values[DELAY]}

        values, linear = self._linear(lambda point: np.array([*constants(point).values()]))
        fitted = np.abs(linear).sum(axis=1) > 0.0
        names = [name for name, used in zip(constants(self.point), fitted, strict=True) if used]
        return names, values[fitted], propagated(linear[fitted], self.covariance)

    def friction(self, sign: float, fastest: float) -> Friction:
        """Return the friction curve in one of `directions`.

        It is that from rest to the fastest recorded speed |v_r|, m/s.
        """
        speed = self.curve_speeds(fastest)
        force, linear = self._linear(lambda point: self.force_at(point, sign, speed))
        variance = np.diag(propagated(linear, self.covariance))
        return Friction(sign, speed, force, np.sqrt(np.maximum(variance, 0.0)))

    def force_at(self, point: FloatArray, sign: float, speed: FloatArray) -> FloatArray:
        """Return the size of steady friction at another point, N, at speeds |v_r|, m/s."""
        law = self.law.friction(self.values_at(point), 1.0)
        return np.array([-sign * float(law.coefficient(sign * w, sign)) for w in speed.tolist()])

    def _linear(
        self, function: Callable[[FloatArray], FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the values of a function of the point, and their derivatives by it."""
        from scipy.optimize import approx_fprime  # takes long to import

        point, base = self.point, function(self.point)
        errors = np.sqrt(np.diag(self.covariance))
        sizes = np.abs(point)
        # Of a number that is nearly zero its error is the size.
        sizes = np.where((sizes < _NEAR_ZERO * errors) & np.isfinite(errors), errors, sizes)
        linear: Any = approx_fprime(point, function, _STEP * np.maximum(sizes, 1e-9))
        return base, np.reshape(linear, (len(base), len(point)))
