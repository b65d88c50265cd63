"""First-order averaging: the vibration is treated as harmonic, X' = A cos t."""

from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.theory.requirements import (
    AUTONOMOUS,
    SPRING,
    STATIC,
    SYMMETRIC,
    require,
)

_PHASES = 2.0 * np.pi * np.arange(1024) / 1024

_ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Share of its terms below which a mean is rounding."""


def averaged_growth(drive: Drive, belt_speed: Any, amplitude: Any) -> FloatArray:
    """Return twice dA/dt of the speed amplitude A, for a belt speed above zero.

    It is (1/pi) int_0^{2 pi} mu(A cos t - v0) cos t dt - 2 beta A (Guckenheimer and Holmes,
    Nonlinear Oscillations, section 4.1, of eq. 5). All values are dimensionless, and the arguments
    may be arrays. The trapezoidal rule is exact to rounding while A <= v0, where the slide does not
    overtake the belt, if the law's characteristic speed is not much below v0 / 10,000. A result
    that cannot be distinguished from rounding is zero. Raises InvalidInputError for a friction law
    that has a memory or differs between the directions, for a belt or load with a course, and
    without a spring.
    """
    require("averaging", drive, SPRING, AUTONOMOUS, STATIC, SYMMETRIC)
    law = drive.dimensionless.friction
    belt_speed, amplitude = np.asarray(belt_speed, float), np.asarray(amplitude, float)
    relative_speed = np.multiply.outer(amplitude, np.cos(_PHASES)) - belt_speed[..., np.newaxis]
    friction = law.coefficient(relative_speed, np.where(relative_speed > 0.0, 1.0, -1.0))
    damping = drive.damping_coefficient * amplitude
    growth = 2.0 * np.mean(friction * np.cos(_PHASES), axis=-1) - damping
    rounding = _ROUNDING * (np.max(np.abs(friction), axis=-1) + damping)
    return np.where(np.abs(growth) < rounding, 0.0, growth)
