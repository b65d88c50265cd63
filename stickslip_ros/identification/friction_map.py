"""Friction laws fitted to pairs of speed and force, from tests at constant speeds."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp, log
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.fit import Estimate
from stickslip_ros.model.friction import Coulomb, Exponential, FrictionLaw
from stickslip_ros.text import must_be_one_of

_LAWS = ("auto", "coulomb", "exponential")
_EXPONENTS = (1.0, 2.0)
_FEWEST = 8
"""Fewest pairs of a direction that was recorded."""
_GRID = 40
"""Decay speeds that are tried first."""
_ROUNDING = 1e-24
"""Share of the squares of the forces that is rounding."""


@dataclass(frozen=True, eq=False)
class FittedCurve:
    """A law fitted to pairs of speed and force."""

    law: FrictionLaw
    """The law for a normal force of 1 N: its coefficients are forces, N."""
    estimates: Mapping[str, Estimate]
    """The constants that were fitted, by name."""
    squares: float
    """Sum of the squared errors of the forces, N^2."""
    pairs: int
    """Number of pairs."""


def fitted_curves(
    velocity: FloatArray, force: FloatArray, law: str = "auto"
) -> Sequence[FittedCurve]:
    """Return the law of pairs of velocity, m/s, and the force that drives the slide, N.

    It is one law for both directions or, where they differ by more than chance, one for forward and
    one for backward motion. Law, exponent and directions are those with the least information
    criterion (Schwarz, Annals of Statistics 6, 1978). Pairs at rest are left out. Raises
    InvalidInputError for another law, and for too few pairs.
    """
    if law not in _LAWS:
        raise InvalidInputError(f"law {law} is invalid: {must_be_one_of(law, _LAWS)}")
    known = np.isfinite(velocity) & np.isfinite(force)
    sides = [side for side in (known & (velocity > 0.0), known & (velocity < 0.0)) if side.any()]
    if not sides or min(map(np.count_nonzero, sides)) < _FEWEST:
        counts = " and ".join(str(np.count_nonzero(side)) for side in sides) or "0"
        raise InvalidInputError(
            f"there are {counts} pairs in a direction of motion: at least {_FEWEST} are needed"
        )
    speed, size = np.abs(velocity), np.sign(velocity) * force
    together = np.any(sides, axis=0)
    return min(
        ([_best(speed[rows], size[rows], law) for rows in parts] for parts in ([together], sides)),
        key=_criterion,
    )


def _best(speed: FloatArray, force: FloatArray, law: str) -> FittedCurve:
    return min(_candidates(speed, force, law), key=lambda curve: _criterion([curve]))


def _criterion(curves: Sequence[FittedCurve]) -> float:
    pairs, squares = sum(fit.pairs for fit in curves), sum(fit.squares for fit in curves)
    constants = sum(len(fit.estimates) for fit in curves)
    return pairs * log(squares / pairs) + constants * log(pairs)


def _candidates(speed: FloatArray, force: FloatArray, law: str) -> Iterator[FittedCurve]:
    one = np.ones_like(speed)
    if law != "exponential":
        (static, viscous), squares = _solved([one, speed], force)
        fitted = Coulomb(max(static, 0.0), viscous)
        yield _curve(fitted, ("static", "viscous"), [one, speed], squares)
    for exponent in _EXPONENTS if law != "coulomb" else ():
        decay_speed = _decay_speed(speed, force, exponent)
        columns = _columns(speed, decay_speed, exponent)
        (kinetic, static, viscous), squares = _solved(columns, force)
        if 0.0 <= kinetic <= static:
            power = (speed / decay_speed) ** exponent
            change = (static - kinetic) * columns[1] * power * exponent / decay_speed
            names = ("kinetic", "static", "viscous", "decay_speed")
            fitted = Exponential(static, kinetic, decay_speed, viscous, exponent)
            yield _curve(fitted, names, [*columns, change], squares)


def _decay_speed(speed: FloatArray, force: FloatArray, exponent: float) -> float:
    """Return the decay speed of the law with least squares, m/s."""
    from scipy.optimize import minimize_scalar  # takes long to import

    def squares(logarithm: float) -> float:
        return _solved(_columns(speed, exp(logarithm), exponent), force)[1]

    grid = np.linspace(log(speed.min() / 3.0), log(speed.max()), _GRID).tolist()
    best = int(np.argmin([squares(decay_speed) for decay_speed in grid]))
    bounds = grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)]
    minimum: Any = minimize_scalar(squares, bounds=bounds, method="bounded")
    return exp(minimum.x)


def _columns(speed: FloatArray, decay_speed: float, exponent: float) -> list[FloatArray]:
    """Return what the kinetic and the static coefficient and the viscous one multiply."""
    decay = np.exp(-((speed / decay_speed) ** exponent))
    return [1.0 - decay, decay, speed]


def _solved(columns: Sequence[FloatArray], force: FloatArray) -> tuple[list[float], float]:
    """Return the least squares solution, and the sum of the squared errors."""
    matrix = np.column_stack(columns)
    values = np.linalg.lstsq(matrix, force)[0]
    left = force - matrix @ values
    least = _ROUNDING * float(force @ force) + np.finfo(float).tiny
    return values.tolist(), max(float(left @ left), least)


def _curve(
    law: FrictionLaw, names: Sequence[str], derivatives: Sequence[FloatArray], squares: float
) -> FittedCurve:
    """Return a fitted law with the standard errors that the derivatives of its force give."""
    matrix = np.column_stack(derivatives)
    pairs, constants = matrix.shape
    covariance = np.linalg.pinv(matrix.T @ matrix) * squares / (pairs - constants)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()
    estimates = {
        name: Estimate(float(getattr(law, name)), error)
        for name, error in zip(names, errors, strict=True)
    }
    return FittedCurve(law, estimates, squares, pairs)
