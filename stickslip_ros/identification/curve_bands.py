"""The friction curve of a fit over the speed, with its band."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.axis_drive import POINTS, table_speeds
from stickslip_ros.identification.intervals import propagated
from stickslip_ros.identification.refinement import Refinement
from stickslip_ros.identification.regression import Regression

_STEP = 1e-5
"""Step of differences, as a share of the value."""


@dataclass(frozen=True, eq=False)
class Friction:
    """A friction curve with its band, in one direction; arrays of shape (points,)."""

    speed: FloatArray
    """Speed |v_r|, m/s, within what was recorded."""
    force: FloatArray
    """Friction force, N."""
    standard_error: FloatArray
    """Standard error of the force, N."""


def friction_of(fit: Regression | Refinement, sign: float, fastest: float) -> Friction:
    """Return the friction curve of a fit, from rest to the fastest recorded speed |v_r|, m/s.

    `sign` is the direction of the slip, 1 or -1; of an axis one that its rows have.
    """
    if isinstance(fit, Refinement):
        return _of_trajectories(fit, sign, fastest)
    direction = [*fit.rows.directions].index(sign)
    speed = table_speeds(fit)
    shape, own = fit.shape(direction), fit.forces(direction)
    terms = fit.curve.terms(speed, shape)
    count, directions = len(own), len(fit.rows.directions)
    by = np.zeros((len(speed), len(fit.covariance)))
    place = len(fit.free) + direction * count
    by[:, place : place + count] = terms
    if len(fit.shapes):
        step = _STEP * shape
        change = (fit.curve.terms(speed, shape + step) - terms) @ own / step
        by[:, len(fit.free) + directions * count + direction] = change
    return Friction(speed, fit.friction(direction, speed), _band(by, fit.covariance))


def _of_trajectories(fit: Refinement, sign: float, fastest: float) -> Friction:
    speed, model = np.linspace(0.0, fastest, POINTS), fit.task.model

    def force(values: Mapping[str, float]) -> FloatArray:
        law = model.drive(values, 1.0).friction
        slip = (sign * speed).tolist()
        return np.array([-sign * float(law.coefficient(each, sign)) for each in slip])

    typical, base = fit.task.typical(fit.values), force(fit.values)
    by = np.zeros((len(speed), len(fit.free)))
    for number, name in enumerate(fit.free):
        step = _STEP * max(abs(fit.values[name]), typical.get(name, 0.0))
        by[:, number] = (force({**fit.values, name: fit.values[name] + step}) - base) / step
    return Friction(speed, base, _band(by, fit.covariance))


def _band(by: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(np.diag(propagated(by, covariance)), 0.0))
