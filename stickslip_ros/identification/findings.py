"""The identified model: constants with intervals, the friction curve, and its predictions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from math import inf, isfinite
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.identification.choice import better_by
from stickslip_ros.identification.filtered import START, filtered
from stickslip_ros.identification.fit import Estimate, Fit, Friction, Residuals
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.rests import static_force
from stickslip_ros.identification.servo import Servo, closed_loop, servo_of
from stickslip_ros.model.drive import Drive
from stickslip_ros.scenarios.sections import FIT_COLUMNS

_STILL_SPEED = 0.02
"""Share of the fastest speed below which a slide may stick."""
_FRICTION_DIFFERENCE = 0.05
"""Difference of friction at any speed, as a share of the largest, by which two laws differ."""
_NAMED_CORRELATION = 0.95
"""Correlation from which two constants are named together."""


@dataclass(frozen=True, eq=False)
class Findings:
    """The model that was chosen, and what the recordings tell of it."""

    records: Sequence[Record]
    """Records to which it was fitted."""
    candidates: Sequence[Fit]
    """Fits of all laws that competed."""
    chosen: Fit
    """The fit of the law that was chosen."""
    as_good: Mapping[str, bool]
    """Whether each candidate, by label, predicts held-out parts as well as the best one."""
    fixed: Mapping[str, float]
    """Constants that were given."""
    left: Sequence[str]
    """Laws that were not fitted to the end, because the time was over."""

    @property
    def normal_force(self) -> float:
        """Normal force that scales the friction, N."""
        return self.fixed.get("normal_force", 1.0)

    @cached_property
    def servo(self) -> Servo | None:
        """The position controller in the first record that has one."""
        servos = map(servo_of, self.records)
        return next((servo for servo in servos if servo is not None), None)

    def behind(self, candidate: Fit) -> float:
        """Return by how many standard errors a law predicts held-out parts worse than the best."""
        allowed = [fit for fit in self.candidates if not fit.remark] or self.candidates
        return better_by(min(allowed, key=lambda fit: fit.error), candidate)

    @property
    def law(self) -> str:
        """Friction law."""
        return self.chosen.law.name

    @cached_property
    def fitted(self) -> Mapping[str, Estimate]:
        """Constants by parameter of the plant, such as `friction.static`; SI units."""
        names, values, _ = self._constants
        return {
            name: Estimate(float(value), float(error))
            for name, value, error in zip(names, values, self._errors, strict=True)
        }

    @cached_property
    def correlations(self) -> Sequence[tuple[str, str, float]]:
        """Pairs of constants whose errors go together, with their correlation."""
        names, shares = [*self.fitted], self._correlation
        near = np.tril(np.abs(shares) > _NAMED_CORRELATION, -1)
        return [(names[j], names[i], float(shares[i, j])) for i, j in np.argwhere(near).tolist()]

    @cached_property
    def _constants(self) -> tuple[list[str], FloatArray, FloatArray]:
        """Names, values and covariance of the constants that are parameters of the plant."""
        return self.chosen.parameters(self.normal_force)

    @property
    def _errors(self) -> FloatArray:
        """Standard errors of these constants."""
        return np.sqrt(np.maximum(np.diag(self._constants[2]), 0.0))

    @property
    def spread(self) -> dict[str, list[Any]]:
        """What the fit leaves open, as a scenario keeps it; see `Scenario.fit`."""
        columns = (
            [f"plant.{name}" for name in self.fitted],
            [estimate.standard_error for estimate in self.fitted.values()],
            self._correlation.ravel().tolist(),
        )
        return dict(zip(FIT_COLUMNS, columns, strict=True)) if self.fitted else {}

    @cached_property
    def _correlation(self) -> FloatArray:
        """Correlations of the constants; 0 where one is unbounded or exact."""
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = self._constants[2] / np.outer(self._errors, self._errors)
        shares = np.where(np.isfinite(shares), shares, 0.0)
        np.fill_diagonal(shares, 1.0)
        return shares

    @cached_property
    def rivals(self) -> Sequence[str]:
        """Laws that predict as well as the one that was chosen, and have another friction."""

        def differs(fit: Fit, curve: Friction) -> bool:
            other = fit.friction(curve.direction, self.fastest)
            away = np.abs(np.interp(curve.speed, other.speed, other.force) - curve.force)
            return float(away.max()) > _FRICTION_DIFFERENCE * float(curve.force.max())

        # The one that was chosen may have been fitted further since.
        others = [fit for fit in self.candidates if fit.label != self.chosen.label]
        alike = [fit for fit in others if self.as_good.get(fit.label) and not fit.remark]
        return [fit.label for fit in alike if any(differs(fit, curve) for curve in self.curves)]

    @property
    def one_belt_speed(self) -> bool:
        """Whether the belt has one velocity in all records."""
        belts = np.concatenate([record.belt_velocity for record in self.records])
        return float(np.ptp(belts)) <= 1e-3 * float(np.abs(belts).max())

    @cached_property
    def _speeds(self) -> Sequence[FloatArray]:
        """Sliding speeds of each record, m/s."""
        columns = (filtered(part, decimated=False) for part in self.records)
        return [np.abs(part.relative_speed) for part in columns]

    @property
    def slowest(self) -> float:
        """Slowest speed |v_r| that was recorded for long, m/s."""
        if slowest := min(float(curve.speed[0]) for curve in self.curves):
            return slowest  # the curve of an axis without rows near reversals
        speeds = np.concatenate(self._speeds)
        return float(np.quantile(speeds[speeds > _STILL_SPEED * float(speeds.max())], 0.02))

    @property
    def stuck(self) -> bool:
        """Whether the slide stuck in a record; the filter blurs short sticking, noise the rest."""
        raw = (
            np.abs(np.diff(record.position) / record.period - record.belt_velocity[1:])
            for record in self.records
        )
        return any(
            np.mean(speeds > _STILL_SPEED * speeds.max()) < 0.98 for speeds in (*self._speeds, *raw)
        )

    def static_forces(self, sign: float) -> tuple[float, float, float]:
        """Return the static friction of the law in a direction, and its bounds by rests, N.

        See `static_force`; `sign` is one of `Fit.directions`.
        """
        chosen, bounds = self.chosen, list[tuple[float, float]]()
        values = chosen.values_at(chosen.point)
        for record in self.records:
            late = record.delayed(chosen.delay)
            held = late.held_force + values["bias_force"] - values["stiffness"] * late.position
            bounds.append(static_force(late, held, sign))
        static = float(chosen.force_at(chosen.point, sign, np.zeros(1))[0])
        return static, max(low for low, _ in bounds), min(high for _, high in bounds)

    @cached_property
    def curves(self) -> Sequence[Friction]:
        """The friction curve over the recorded speeds, in each direction that was recorded."""
        chosen = self.chosen
        return [chosen.friction(sign, self.fastest) for sign in chosen.directions]

    @property
    def fastest(self) -> float:
        """Fastest speed |v_r| that was recorded, m/s."""
        return max(float(speeds.max()) for speeds in self._speeds)

    @cached_property
    def drive(self) -> Drive:
        """The drive, with the usual belt speed of the first record: the median where it moves."""
        return self.chosen.drive(self.normal_force, _usual(self.records[0].belt_velocity))

    def force_error(self, record: Record) -> float | None:
        """Return the rms of F - F_model over that of F, on filtered rows; None without a force."""
        if not record.held_force.any():
            return None
        errors = self.chosen.errors(record)
        return rms(errors.error) / rms(errors.force) if len(errors.force) else None

    @cached_property
    def free_run(self) -> Callable[[Record], FloatArray]:
        """The positions that the model runs through, with the recorded force and no feedback.

        The velocity at the start is the one that fits best. A drive on a spring starts where the
        slide is fast relative to the belt, at the position that fits best, too; NaN before.
        """
        return cache(self.chosen.free_run)

    def free_run_error(self, record: Record) -> float:
        """Return the rms error of `free_run`, m; infinite of an unbounded motion."""
        away = self.free_run(record) - record.position
        error = rms(away[~(record.lost | (self.chosen.has_spring & np.isnan(away)))])
        return error if isfinite(error) else inf

    @cached_property
    def residuals(self) -> Callable[[Record], Residuals]:
        """What the model leaves of a record.

        Of a drive on a spring these are the position errors in segments like those of the fit, each
        from the state that fits best. The model of an axis is fitted to the forces.
        """
        return cache(self.chosen.residuals)

    def check(self, record: Record) -> dict[str, float | None]:
        """Return what the model predicts of a record; None for what it cannot.

        `free_run_error` and `segment_error` are in m, the others are shares of the rms of what was
        recorded. What is unbounded is infinite.
        """
        record.require_motion()
        check = {
            "force_error": self.force_error(record),
            "free_run_error": self.free_run_error(record),
            "segment_error": rms(self.residuals(record).error) if self.chosen.has_spring else None,
            "position_error": None,
            "closed_loop_force_error": None,
        }
        led = record.led
        if self.servo is not None and led is not None and led.force is not None:
            position, force = closed_loop(led, self.drive, self.servo, self.chosen.delay)
            check["position_error"] = _relative(position[START:], led.position[START:])
            check["closed_loop_force_error"] = _relative(force[START:], led.force[START:])
        return check


def _usual(belt: FloatArray) -> float:
    """Return the median speed of a belt where it moves, in its more frequent direction."""
    size = np.abs(belt)
    moving = belt[size > _STILL_SPEED * float(size.max())]
    if not len(moving):
        return 0.0
    sign = 1.0 if np.mean(moving > 0.0) >= 0.5 else -1.0
    return float(np.median(moving[moving * sign > 0.0]))


def _relative(predicted: FloatArray, measured: FloatArray) -> float:
    """Return the rms error as a share of what was measured; infinite of an unbounded motion."""
    return rms(predicted - measured) / rms(measured) if np.isfinite(predicted).all() else inf
