"""Regression of the equation of motion on filtered records."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.curves import Curve, followed
from stickslip_ros.identification.filtered import Filtered
from stickslip_ros.identification.intervals import BLOCKS, block_covariance

_DIRECTION_SHARE = 0.05
"""Least share of the rows of a direction that has a curve of its own."""
_FASTEST_SHAPE = 4.0
"""Largest shape of a curve that is sought, in fastest speeds."""
LINEAR = ("mass", "damping", "stiffness", "bias_force")
"""Constants of the equation beside those of friction."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of the equation of motion of all records, arrays of shape (rows,)."""

    parts: Sequence[Filtered]
    columns: Mapping[str, FloatArray]
    """Factor of each of `LINEAR`."""
    force: FloatArray
    """Known forces, N."""
    block: IntArray
    """Number of the block of time."""
    directions: Sequence[float]
    """Signs of the relative speed that occur: 1, -1 or both."""

    @classmethod
    def of(cls, parts: Sequence[Filtered]) -> "Rows":
        """Return the rows of filtered records."""

        def joined(values: Callable[[Filtered], FloatArray]) -> FloatArray:
            return np.concatenate([part.rows(values(part)) for part in parts])

        force = joined(lambda part: part.force)
        if len(force) < 4 * BLOCKS:
            raise InvalidInputError(
                f"the slide slips in {len(force)} rows of the recordings: identification needs "
                f"at least {4 * BLOCKS}"
            )
        relative = joined(lambda part: part.relative_speed)
        directions = directions_of(relative)
        if not directions:
            raise InvalidInputError("the slide never slips in the recordings: they tell nothing")
        return cls(
            parts,
            {
                "mass": joined(lambda part: part.acceleration),
                "damping": joined(lambda part: part.velocity),
                "stiffness": joined(lambda part: part.position),
                "bias_force": -np.ones(len(force)),
            },
            force,
            np.arange(len(force)) * BLOCKS // len(force),
            directions,
        )

    @cached_property
    def speeds(self) -> FloatArray:
        """Size of the relative speeds above zero, m/s, sorted."""
        speeds = np.abs(np.concatenate([part.rows(part.relative_speed) for part in self.parts]))
        return np.sort(speeds[speeds > 0.0])

    def least_shape(self, curve: Curve) -> float:
        """Return the smallest shape of a curve that the rows tell, m/s."""
        return curve.least_shape * float(np.quantile(self.speeds, 0.02))

    def friction_terms(self, curve: Curve, shapes: FloatArray) -> FloatArray:
        """Return sgn(v_r) times the terms of a curve for each direction, shape (rows, terms)."""
        made: list[FloatArray] = []
        for part in self.parts:
            speed, columns = part.relative_speed, list[FloatArray]()
            for number, sign in enumerate(self.directions):
                shape = float(shapes[number]) if len(shapes) else 1.0
                signs = np.sign(speed)
                if len(self.directions) > 1:
                    signs = np.where(speed * sign > 0.0, sign, 0.0)
                columns.append(signs[:, None] * curve.terms(np.abs(speed), shape))
            terms = np.hstack(columns)
            if curve.deflection > 0.0:
                path = np.abs(speed) * (part.time[1] - part.time[0]) / curve.deflection
                terms = followed(terms, path)
            made.append(part.rows(terms))
        return np.vstack(made)


def directions_of(relative: FloatArray) -> Sequence[float]:
    """Return the signs of relative speeds that are not rare: 1, -1 or both; none at rest."""
    counts = {sign: np.count_nonzero(relative * sign > 0.0) for sign in (1.0, -1.0)}
    return [sign for sign, count in counts.items() if count > _DIRECTION_SHARE * len(relative)]


@dataclass(frozen=True, eq=False)
class Regression:
    """The equation of motion with a friction curve in each direction, fitted to rows."""

    rows: Rows
    curve: Curve
    free: Sequence[str]
    """Constants of `LINEAR` that are fitted."""
    fixed: Mapping[str, float]
    """Values of the others."""
    shapes: FloatArray
    """Shape of the curve in each direction of the rows, m/s; empty without a shape."""
    values: FloatArray
    """Fitted constants: those of `free`, then the forces of the curve for each direction."""

    @property
    def constants(self) -> dict[str, float]:
        """Value of each of `LINEAR`."""
        return {**self.fixed, **dict(zip(self.free, self.values.tolist(), strict=False))}

    def forces(self, number: int) -> FloatArray:
        """Return the forces of the curve in a direction of the rows, N."""
        own = np.array_split(self.values[len(self.free) :], len(self.rows.directions))
        return own[number]

    def shape(self, number: int) -> float:
        """Return the shape of the curve in a direction of the rows, m/s; 1 without one."""
        return float(self.shapes[number]) if len(self.shapes) else 1.0

    def friction(self, number: int, speed: FloatArray) -> FloatArray:
        """Return the friction force in a direction of the rows, N, at speeds |v_r|, m/s."""
        return self.curve.terms(speed, self.shape(number)) @ self.forces(number)

    def at(self, point: FloatArray) -> "Regression":
        """Return the same with the values and then the shapes of a point."""
        count = len(self.values)
        shapes = point[count : count + len(self.shapes)]
        return replace(self, values=point[:count], shapes=shapes)

    def require(self, *names: str) -> None:
        """Raise InvalidInputError if one of these constants is not above zero."""
        for name in names:
            if not self.constants[name] > 0.0:
                raise InvalidInputError(
                    f"the {name} comes out as 0: the forces do not fit the motion; check their "
                    "sign and unit, and whether one is missing"
                )

    def refitted(self) -> "Regression":
        """Return the fit to its rows with the same shapes."""
        return _solved(self.rows, self.curve, self.free, self.fixed, self.shapes)

    @cached_property
    def residual(self) -> FloatArray:
        """Known forces less those of the model, N, by row."""
        return self._residual_with(self.shapes)

    def _residual_with(self, shapes: FloatArray) -> FloatArray:
        design, wanted = system(self.rows, self.curve, self.free, self.fixed, shapes)
        return wanted - design @ self.values

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of `values` and `shapes`, from the scatter over the blocks of time."""
        columns = [system(self.rows, self.curve, self.free, self.fixed, self.shapes)[0]]
        for number, shape in enumerate(self.shapes):
            step = np.where(np.arange(len(self.shapes)) == number, 1e-4 * shape, 0.0)
            change = self._residual_with(self.shapes - step)
            change -= self._residual_with(self.shapes + step)
            columns.append((change / (2e-4 * shape))[:, None])
        return block_covariance(np.hstack(columns), self.residual)

    @cached_property
    def held_out(self) -> FloatArray:
        """Mean square of the residual in each block, N^2, fitted without it; shape (blocks,)."""
        design, wanted = system(self.rows, self.curve, self.free, self.fixed, self.shapes)
        losses = np.empty(BLOCKS)
        for block in range(BLOCKS):
            held = self.rows.block == block
            values = solve(design[~held], wanted[~held], self.least)
            own = wanted[held] - design[held] @ values
            losses[block] = np.mean(own * own)
        return losses

    @property
    def least(self) -> FloatArray:
        """Smallest value of each of `values`."""
        return _least(self.rows, self.curve, self.free)


def regress(
    rows: Rows,
    curve: Curve,
    free: Sequence[str],
    fixed: Mapping[str, float],
    shape: float | None = None,
) -> Regression:
    """Fit the equation m a + c v + k x - bias + sgn(v_r) F(|v_r|) = u to rows.

    The curve F has forces of its own in each direction of the rows. `free` are the constants of
    `LINEAR` that are fitted, `fixed` has the others. The shape of the curve, m/s, is fitted in each
    direction unless it is given.
    """
    if not curve.shaped:
        return _solved(rows, curve, free, fixed, np.empty(0))
    if shape is not None:
        return _solved(rows, curve, free, fixed, np.full(len(rows.directions), shape))
    from scipy.optimize import least_squares

    high = float(np.log(_FASTEST_SHAPE * np.quantile(rows.speeds, 0.98)))
    low = float(np.log(rows.least_shape(curve)))

    def residual(logarithms: FloatArray) -> FloatArray:
        shapes = np.broadcast_to(np.exp(logarithms), len(rows.directions))
        return _solved(rows, curve, free, fixed, shapes).residual

    grid = np.linspace(low, high, 9)[1:-1]
    best = grid[np.argmin([np.sum(residual(np.array([each])) ** 2) for each in grid])]
    start = np.full(len(rows.directions), best)
    found = least_squares(residual, start, bounds=(low, high), diff_step=1e-4, xtol=1e-6)
    return _solved(rows, curve, free, fixed, np.exp(found.x))


def _solved(
    rows: Rows, curve: Curve, free: Sequence[str], fixed: Mapping[str, float], shapes: FloatArray
) -> Regression:
    """Return the fit with given shapes."""
    values = solve(*system(rows, curve, free, fixed, shapes), _least(rows, curve, free))
    return Regression(rows, curve, free, fixed, shapes, values)


def _least(rows: Rows, curve: Curve, free: Sequence[str]) -> FloatArray:
    """Return the smallest value of each unknown."""
    linear = [-np.inf if name == "bias_force" else 0.0 for name in free]
    return np.array([*linear, *[*curve.least] * len(rows.directions)])


def solve(design: FloatArray, wanted: FloatArray, least: FloatArray) -> FloatArray:
    """Return the unknowns by least squares."""
    from scipy.optimize import lsq_linear

    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    values = np.linalg.lstsq(design / scale, wanted, rcond=None)[0]
    if (values < least).any():
        values = lsq_linear(design / scale, wanted, (least, np.inf), method="bvls").x
    return values / scale


def system(
    rows: Rows,
    curve: Curve,
    free: Sequence[str],
    fixed: Mapping[str, float],
    shapes: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the matrix of the unknowns and what it is to give."""
    wanted = rows.force - sum(value * rows.columns[name] for name, value in fixed.items())
    linear = [rows.columns[name][:, None] for name in free]
    return np.hstack([*linear, rows.friction_terms(curve, shapes)]), wanted
