"""The run of a drive through a whole record, with its force and without feedback."""

from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.model.drive import Drive

_FIRST = 20
"""Samples from which the velocity at the start is found."""
_UNBOUNDED_LOSS = 1e300
"""Squared error of a motion that is not bounded, m^2."""
_SPEED_TOLERANCE = 1e-3
"""Tolerance of the velocity at the start, as a share of the range in which it is sought."""


def free_run(predictor: Predictor, drive: Drive) -> tuple[float, FloatArray]:
    """Return the motion of a drive through a whole record, with its force and without feedback.

    It starts at the measured position with the velocity that fits best, m/s, which is returned
    before the positions, m. The velocity is found by bounded minimization (R. P. Brent, Algorithms
    for Minimization Without Derivatives, 1973) around that of the first samples.
    """
    from scipy.optimize import minimize_scalar  # takes long to import

    record, first = predictor.record, predictor.record.position[:_FIRST]
    slope = float(np.polyfit(np.arange(len(first)) * record.period, first, 1)[0])
    # The range also makes up for the friction over the first stroke.
    spread = 3.0 * abs(slope) + float(np.std(np.diff(first))) / record.period

    def loss(velocity: float) -> float:
        error = predictor.positions(drive, float(velocity)) - record.position
        return float(np.mean(error * error)) if np.isfinite(error).all() else _UNBOUNDED_LOSS

    solve: Any = minimize_scalar  # its types know no bounds
    bounds, options = (slope - spread, slope + spread), {"xatol": _SPEED_TOLERANCE * spread}
    velocity = float(solve(loss, bounds=bounds, method="bounded", options=options).x)
    return velocity, predictor.positions(drive, velocity)
