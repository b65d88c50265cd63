"""Regression of the equation of motion on filtered records."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.covariance import BLOCKS, block_covariance
from stickslip_ros.identification.filtered import filtered
from stickslip_ros.identification.fit import Fit, ForceErrors, Friction
from stickslip_ros.identification.identified_law import DELAY, IdentifiedLaw
from stickslip_ros.identification.laws import DirectionalAdapter
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression_rows import Rows

_FASTEST_SHAPE = 4.0
"""Largest shape of a curve that is sought, in fastest speeds."""
_CLEAR_ERRORS = 4.0
"""Standard errors of the mean residual at a speed from which it is more than noise."""
_BINS = 10
"""Bins of speed in which the residuals of a direction are averaged."""
_LEAST_ERROR = 1e-4
"""Least error of rows, as a share of the forces: without noise, filters and differences leave up to
a quarter of it, with the same sign in all blocks."""


@dataclass(frozen=True, eq=False)
class Regression(Fit):
    """The equation of motion with a friction curve in each direction, fitted to rows."""

    has_spring = False
    least_gain = 3e-3  # the filters blur reversals
    rows: Rows
    curve: IdentifiedLaw
    """Law whose terms are fitted in each direction."""
    free: Sequence[str]
    """Constants of `LINEAR` that are fitted."""
    fixed: Mapping[str, float]
    """Values of the others."""
    shapes: FloatArray
    """Shape of the curve in each direction of the rows, m/s; empty without a shape."""
    unknowns: FloatArray
    """Fitted constants: those of `free`, then the forces of the curve for each direction."""

    @property
    @override
    def law(self) -> IdentifiedLaw:
        return DirectionalAdapter(self.curve) if len(self.directions) > 1 else self.curve

    @property
    @override
    def directions(self) -> Sequence[float]:
        return self.rows.directions

    @property
    @override
    def scale(self) -> float:
        return rms(self.rows.force) or rms(self.system[1])

    @property
    @override
    def point(self) -> FloatArray:
        return np.concatenate([self.unknowns, self.shapes])

    @property
    def constants(self) -> dict[str, float]:
        """Value of each of `LINEAR`."""
        return {**self.fixed, **dict(zip(self.free, self.unknowns.tolist(), strict=False))}

    @property
    def curves(self) -> Sequence[tuple[FloatArray, float]]:
        """Forces of the curve, N, and its shape, m/s, in each direction; 1 without a shape."""
        forces = np.array_split(self.unknowns[len(self.free) :], len(self.directions))
        return [*zip(forces, self.shapes.tolist() or [1.0] * len(forces), strict=True)]

    @property
    def coordinates(self) -> Sequence[dict[str, float]]:
        """Coordinates of the curve in each direction of the rows."""
        return [self.curve.coordinates_of(forces.tolist(), shape) for forces, shape in self.curves]

    @override
    def values_at(self, point: FloatArray) -> Mapping[str, float]:
        moved = self.at(point)
        delay = {DELAY: self.rows.delay or 0.0}
        return {**moved.constants, **self.curve.joined(moved.coordinates), **delay}

    @override
    def curve_speeds(self, fastest: float) -> FloatArray:
        speeds = self.rows.curve_speeds if self.curve.speeds is None else self.curve.speeds
        return speeds[1:] if self.rows.resting else speeds  # nothing is known of slower slip

    @override
    def errors(self, record: Record) -> ForceErrors:
        path = self.rows.parts[0].path
        columns = filtered(record, decimated=True, delay=self.rows.delay, path=path)
        rows = replace(Rows.of_records([columns]), directions=self.directions)
        error = replace(self, rows=rows).residual
        friction = -rows.friction_terms(self.curve, self.shapes) @ self.unknowns[len(self.free) :]
        time, position, speed, force = (
            columns.rows(column)
            for column in (columns.time, columns.position, columns.relative_speed, columns.force)
        )
        return ForceErrors(time, position, speed, error, error - friction, force)

    @override
    def free_run(self, record: Record) -> FloatArray:
        return Predictor(record.delayed(self.delay)).free_run(self.drive(1.0))[1]

    def at(self, point: FloatArray) -> "Regression":
        """Return the same with the unknowns and then the shapes of a point."""
        count = len(self.unknowns)
        shapes = point[count : count + len(self.shapes)]
        return replace(self, unknowns=point[:count], shapes=shapes)

    def require(self, *names: str) -> None:
        """Raise InvalidInputError if one of these constants is not above zero."""
        for name in names:
            if not self.constants[name] > 0.0:
                raise InvalidInputError(
                    f"the {name} comes out as 0: the forces do not fit the motion; check their "
                    "sign and unit, and whether one is missing"
                )

    def refitted(self, shapes: FloatArray | None = None) -> "Regression":
        """Return the fit to its rows with the same shapes, or with other ones."""
        fit = self if shapes is None else replace(self, shapes=shapes)
        return replace(fit, unknowns=solve(*fit.system, fit.least))

    @property
    def system(self) -> tuple[FloatArray, FloatArray]:
        """The matrix of the unknowns and what it is to give."""
        rows = self.rows
        wanted = rows.force - sum(value * rows.columns[name] for name, value in self.fixed.items())
        linear = [rows.columns[name][:, None] for name in self.free]
        return np.hstack([*linear, rows.friction_terms(self.curve, self.shapes)]), wanted

    @cached_property
    def residual(self) -> FloatArray:
        """Known forces less those of the model, N, by row."""
        design, wanted = self.system
        return wanted - design @ self.unknowns

    @cached_property
    def misfit(self) -> Sequence[tuple[FloatArray, FloatArray, FloatArray]]:
        """What is left of friction over the speed, by direction: arrays of shape (bins,).

        Mean speed, m/s, mean of the friction that was measured less that of the curve, N, and its
        standard error, N.
        """
        bins: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        for sign in self.directions:
            rows = self.rows.relative_speed * sign > 0.0
            speed, left = sign * self.rows.relative_speed[rows], sign * self.residual[rows]
            place = np.argsort(np.argsort(speed)) * _BINS // len(speed)
            member = (place[:, None] == np.arange(_BINS)).astype(float)
            mean, middle = (member.T @ values / member.sum(axis=0) for values in (left, speed))
            covariance = block_covariance(member, left - member @ mean)
            bins.append((middle, mean, np.sqrt(np.diag(covariance))))
        return bins

    @property
    @override
    def doubt(self) -> str:
        damping = self.constants["damping"]
        if any(way.get("viscous", 0.0) + damping < 0.0 for way in self.coordinates):
            return "its viscous friction is negative"
        for speed, mean, error in self.misfit:
            size = np.abs(mean) - np.maximum(_CLEAR_ERRORS * error, self.least_gain * self.scale)
            worst = int(np.argmax(size))
            if size[worst] > 0.0:
                return (
                    f"its errors have structure over the speed: {mean[worst]:+.3g} N at "
                    f"{1e3 * speed[worst]:.3g} mm/s"
                )
        return ""

    @override
    def friction(self, sign: float, fastest: float) -> Friction:
        curve = super().friction(sign, fastest)
        speed, mean, error = self.misfit[[*self.directions].index(sign)]
        # The band has what was measured, where the curve misses it by more than noise.
        missed = np.sqrt(np.maximum(mean * mean - error * error, 0.0))
        errors = np.hypot(curve.standard_error, np.interp(curve.speed, speed, missed))
        if not self.curve.shaped and self.curve.speeds is not None:
            # A straight line misses a quarter of what its knots are off the chord beside them.
            low, high = curve.speed[:-2], curve.speed[2:]
            share = (curve.speed[1:-1] - low) / (high - low)
            chord = curve.force[:-2] + share * (curve.force[2:] - curve.force[:-2])
            errors = np.hypot(errors, 0.25 * np.pad(np.abs(curve.force[1:-1] - chord), 1, "edge"))
        return replace(curve, standard_error=errors)

    @override
    def linearized(self) -> tuple[FloatArray, FloatArray, int]:
        columns = [self.system[0]]
        for number, shape in enumerate(self.shapes):
            step = np.where(np.arange(len(self.shapes)) == number, 1e-4 * shape, 0.0)
            below, above = (replace(self, shapes=self.shapes + sign * step) for sign in (-1, 1))
            columns.append(((below.residual - above.residual) / (2e-4 * shape))[:, None])
        least = _LEAST_ERROR * self.scale / max(rms(self.residual), np.finfo(float).tiny)
        return np.hstack(columns), self.residual * max(least, 1.0), 0

    def validated(self) -> "Regression":
        """Return the same with its errors in blocks of time that are held out one by one."""
        design, wanted = self.system
        losses, blocks = np.empty(BLOCKS), np.arange(len(wanted)) * BLOCKS // len(wanted)
        for block in range(BLOCKS):
            held = blocks == block
            values = solve(design[~held], wanted[~held], self.least)
            left = wanted[held] - design[held] @ values
            losses[block] = np.mean(left * left)
        return replace(self, held_out=losses)

    @property
    def least(self) -> FloatArray:
        """Smallest value of each of `unknowns`."""
        linear = [-np.inf if name == "bias_force" else 0.0 for name in self.free]
        return np.array([*linear, *[*self.curve.least] * len(self.directions)])


def regress(
    rows: Rows,
    curve: IdentifiedLaw,
    free: Sequence[str],
    fixed: Mapping[str, float],
    shape: float | None = None,
) -> Regression:
    """Fit the equation m a + c v + k x - bias + sgn(v_r) F(|v_r|) = u to rows.

    The curve F has forces of its own in each direction of the rows. `free` are the constants of
    `LINEAR` that are fitted, `fixed` has the others. All are linear least squares (M. Gautier, W.
    Khalil, Exciting trajectories for the identification of base inertial parameters of robots,
    International Journal of Robotics Research 11(4), 1992); the shape of the curve, m/s, is fitted
    in each direction around them (variable projection, see `refine`) unless it is given.
    """
    fit = Regression(rows, curve, free, fixed, np.empty(0), np.empty(0))
    directions = len(rows.directions)
    if not curve.shaped:
        return fit.refitted()
    if shape is not None:
        return fit.refitted(np.full(directions, shape))
    from scipy.optimize import least_squares

    high = float(np.log(_FASTEST_SHAPE * np.quantile(rows.speeds, 0.98)))
    low = float(np.log(rows.least_shape(curve)))

    def residual(logarithms: FloatArray) -> FloatArray:
        shaped = replace(fit, shapes=np.broadcast_to(np.exp(logarithms), directions))
        design, wanted = shaped.system
        return wanted - design @ solve(design, wanted, shaped.least)

    grid = np.linspace(low, high, 9)[1:-1]
    best = grid[np.argmin([np.sum(residual(np.array([logarithm])) ** 2) for logarithm in grid])]
    start = np.full(directions, best)
    optimum = least_squares(residual, start, bounds=(low, high), diff_step=1e-4, xtol=1e-6)
    return fit.refitted(np.exp(optimum.x))


def solve(design: FloatArray, wanted: FloatArray, least: FloatArray) -> FloatArray:
    """Return the unknowns by least squares, none below `least`.

    Where the free solution goes below, it is that by bounded-variable least squares (P. B. Stark,
    R. L. Parker, Computational Statistics 10, 1995).
    """
    from scipy.optimize import lsq_linear

    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    values = np.linalg.lstsq(design / scale, wanted, rcond=None)[0]
    if (values < least).any():
        values = lsq_linear(design / scale, wanted, (least, np.inf), method="bvls").x
    return values / scale
