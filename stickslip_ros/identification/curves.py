"""Friction curves that are linear in their unknown forces, for regression."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray


class Curve(ABC):
    """Size of the friction force over the speed |v_r|, a sum of terms with unknown forces.

    A curve may have one shape, a speed, in which it is not linear.
    """

    name: str
    """Name of the friction law that has this curve."""
    least: Sequence[float]
    """Smallest value of each unknown force: 0 or minus infinity."""
    shaped: bool = False
    """Whether the curve has a shape."""
    least_shape: float = 0.25
    """Smallest shape that records tell, in their slowest speeds."""
    deflection: float = 0.0
    """Path over which friction follows a change of direction or speed, m; 0: immediately."""

    @abstractmethod
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return the terms, rows of shape (rows, terms); `speed` is |v_r| and `shape` in m/s."""


class CoulombCurve(Curve):
    """F = F_s + F_v w."""

    name = "coulomb"
    least = 0.0, 0.0

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return np.column_stack([np.ones_like(speed), speed])


class StribeckCurve(Curve):
    """F = F_s - D (3 r - r^3)/2 with r = w/v_m, eq. 3 of the paper."""

    name = "stribeck"
    least = 0.0, 0.0
    shaped = True

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        ratio = speed / shape
        return np.column_stack([np.ones_like(speed), -0.5 * (3.0 * ratio - ratio**3)])


class ExponentialCurve(Curve):
    """F = F_k + D exp(-w/v_s) + F_v w; the viscous force may be negative."""

    name = "exponential"
    least = 0.0, 0.0, -np.inf
    shaped = True

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return np.column_stack([np.ones_like(speed), np.exp(-speed / shape), speed])


class SaturatingCurve(Curve):
    """F = F_0 + R (1 - exp(-w/v_s)) + F_v w: friction that rises ever less, as of ball screws."""

    name = "table"
    least = 0.0, 0.0, 0.0
    shaped = True
    least_shape = 1.0  # a rise far below the slowest speed is one with the force at rest

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return np.column_stack([np.ones_like(speed), 1.0 - np.exp(-speed / shape), speed])


class SteppedCurve(Curve):
    """Straight lines between knots: whatever the friction is."""

    name = "table"

    def __init__(self, knots: tuple[float, ...]) -> None:
        """Take the speeds of the knots, m/s, increasing from 0."""
        self.knots = knots
        self.least = (0.0, *[-np.inf] * (len(knots) - 1))

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        low, high = np.array(self.knots[:-1]), np.array(self.knots[1:])
        shares = np.clip((speed[:, None] - low) / (high - low), 0.0, 1.0)
        return np.column_stack([np.ones_like(speed), shares])


class FollowedCurve(Curve):
    """Curve that friction follows over a path, as bristles do: F' = |v_r| (F_curve - F) / d.

    It is the LuGre law without damping of the bristles, of one deflection d at all speeds.
    """

    name = "lugre"

    def __init__(self, curve: Curve, deflection: float) -> None:
        """Take the curve in steady slip, and the deflection, m."""
        self.curve, self.deflection = curve, deflection
        self.least, self.shaped = curve.least, curve.shaped
        self.least_shape = curve.least_shape

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return self.curve.terms(speed, shape)


def followed(terms: FloatArray, path: FloatArray) -> FloatArray:
    """Return terms, shape (samples, terms), as friction follows them over a path.

    `path` is that from the sample before, in deflections; the terms have the sign of the slip.
    """
    found = np.empty_like(terms)
    state = terms[0]
    for number, (target, kept) in enumerate(zip(terms, np.exp(-path).tolist(), strict=True)):
        state = target + (state - target) * kept
        found[number] = state
    return found
