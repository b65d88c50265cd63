"""The drive that a regression of an axis stands for, and its friction as a table."""

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.curves import (
    CoulombCurve,
    ExponentialCurve,
    FollowedCurve,
    SteppedCurve,
    StribeckCurve,
)
from stickslip_ros.identification.regression import Regression
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import (
    Coulomb,
    Directional,
    Exponential,
    FrictionLaw,
    LuGre,
    Stribeck,
    Table,
)

_LEAST_FRICTION = 0.01
"""Least friction of bristles at a speed, as a share of the largest."""
POINTS = 40
"""Points that stand for a curve."""

Points = tuple[tuple[float, float], ...]
"""Pairs of speed, m/s, and coefficient."""


def table_speeds(fit: Regression) -> FloatArray:
    """Return the speeds of the points that stand for a curve, m/s: 0 and those recorded."""
    if isinstance(fit.curve, SteppedCurve):
        return np.array(fit.curve.knots)
    low, high = np.quantile(fit.rows.speeds, [0.02, 1.0])
    return np.concatenate([[0.0], np.geomspace(low, high, POINTS - 1)])


def table_of(fit: Regression, direction: int, normal_force: float) -> Points:
    """Return points of speed (m/s) and coefficient of the curve in a direction of the rows."""
    speed = table_speeds(fit)
    size = np.maximum(fit.friction(direction, speed), 0.0) / normal_force
    return tuple(zip(speed.tolist(), size.tolist(), strict=True))


def axis_drive(fit: Regression, normal_force: float, belt_speed: float) -> Drive:
    """Return the drive that a regression stands for."""
    laws = [law_of(fit, number, normal_force) for number in range(len(fit.rows.directions))]
    constants = fit.constants
    return Drive(
        mass=constants["mass"],
        damping=max(constants["damping"], 0.0),
        stiffness=max(constants["stiffness"], 0.0),
        normal_force=normal_force,
        belt_speed=belt_speed,
        friction=laws[0] if len(laws) == 1 else Directional(*laws),
        bias_force=constants["bias_force"],
    )


def law_of(fit: Regression, direction: int, normal_force: float) -> FrictionLaw:
    """Return the friction law in a direction of the rows."""
    first, *others = (fit.forces(direction) / normal_force).tolist()
    if isinstance(fit.curve, CoulombCurve):
        return Coulomb(static=first, viscous=others[0])
    if isinstance(fit.curve, StribeckCurve):
        return Stribeck(
            static=first,
            minimum=max(first - others[0], 0.0),
            minimum_speed=float(fit.shapes[direction]),
        )
    if isinstance(fit.curve, ExponentialCurve):
        return Exponential(
            static=first + others[0],
            kinetic=first,
            decay_speed=float(fit.shapes[direction]),
            viscous=others[1],
        )
    points = table_of(fit, direction, normal_force)
    if not isinstance(fit.curve, FollowedCurve):
        return Table(points)
    # A law has one contact: the mean friction of both directions is that of its stiffness.
    tables = (table_of(fit, number, normal_force) for number in range(len(fit.rows.directions)))
    mean = float(np.mean([max(size for _, size in each) for each in tables]))
    # Bristles need friction to deflect.
    points = tuple((speed, max(size, _LEAST_FRICTION * mean)) for speed, size in points)
    stiffness = mean / fit.curve.deflection
    return LuGre(Table(points), bristle_stiffness=stiffness, bristle_damping=0.0)
