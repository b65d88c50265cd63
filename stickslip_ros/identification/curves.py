"""Friction curves that are linear in their unknown forces, for regression."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stickslip_ros.arrays import FloatArray


class Curve(ABC):
    """Size of the friction force over the speed |v_r|, a sum of terms with unknown forces.

    A curve may have one shape, a speed, in which it is not linear.
    """

    name: ClassVar[str]
    """Name of the friction law that has this curve."""
    deflection: float = 0.0
    """Path over which friction follows a change of direction or speed, m; 0: immediately."""

    @property
    def shaped(self) -> bool:
        """Whether the curve has a shape."""
        return False

    @property
    def least_shape(self) -> float:
        """Smallest shape that records tell, in their slowest speeds."""
        return 0.25

    @abstractmethod
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return the terms, rows of shape (rows, terms); `speed` is |v_r| and `shape` in m/s."""

    @property
    @abstractmethod
    def least(self) -> Sequence[float]:
        """Smallest value of each unknown force: 0 or minus infinity."""


@dataclass(frozen=True)
class CoulombCurve(Curve):
    """F = F_s + F_v w."""

    name: ClassVar[str] = "coulomb"

    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return 1 and w; see `Curve.terms`."""
        return np.column_stack([np.ones_like(speed), speed])

    @property
    def least(self) -> Sequence[float]:
        """No negative force."""
        return 0.0, 0.0


@dataclass(frozen=True)
class StribeckCurve(Curve):
    """F = F_s - D (3 r - r^3)/2 with r = w/v_m, eq. 3 of the paper."""

    name: ClassVar[str] = "stribeck"

    @property
    def shaped(self) -> bool:
        """True: its shape is a speed."""
        return True

    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return 1 and the drop; see `Curve.terms`."""
        ratio = speed / shape
        return np.column_stack([np.ones_like(speed), -0.5 * (3.0 * ratio - ratio**3)])

    @property
    def least(self) -> Sequence[float]:
        """No negative force."""
        return 0.0, 0.0


@dataclass(frozen=True)
class ExponentialCurve(Curve):
    """F = F_k + D exp(-w/v_s) + F_v w."""

    name: ClassVar[str] = "exponential"

    @property
    def shaped(self) -> bool:
        """True: its shape is a speed."""
        return True

    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return 1, the decay and w; see `Curve.terms`."""
        return np.column_stack([np.ones_like(speed), np.exp(-speed / shape), speed])

    @property
    def least(self) -> Sequence[float]:
        """No negative force; the viscous one may be."""
        return 0.0, 0.0, -np.inf


@dataclass(frozen=True)
class SaturatingCurve(Curve):
    """F = F_0 + R (1 - exp(-w/v_s)) + F_v w: friction that rises ever less, as of ball screws."""

    name: ClassVar[str] = "table"

    @property
    def shaped(self) -> bool:
        """True: its shape is a speed."""
        return True

    @property
    def least_shape(self) -> float:
        """1: a rise far below the slowest speed is one with the force at rest."""
        return 1.0

    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return 1, the rise and w; see `Curve.terms`."""
        return np.column_stack([np.ones_like(speed), 1.0 - np.exp(-speed / shape), speed])

    @property
    def least(self) -> Sequence[float]:
        """No negative force: the curve is monotone."""
        return 0.0, 0.0, 0.0


@dataclass(frozen=True)
class SteppedCurve(Curve):
    """Straight lines between knots: whatever the friction is."""

    name: ClassVar[str] = "table"
    knots: tuple[float, ...]
    """Speeds of the knots, m/s, increasing from 0."""

    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return 1 and the share of each step; see `Curve.terms`."""
        low, high = np.array(self.knots[:-1]), np.array(self.knots[1:])
        shares = np.clip((speed[:, None] - low) / (high - low), 0.0, 1.0)
        return np.column_stack([np.ones_like(speed), shares])

    @property
    def least(self) -> Sequence[float]:
        """Steps up and down."""
        return (0.0, *[-np.inf] * (len(self.knots) - 1))


@dataclass(frozen=True)
class FollowedCurve(Curve):
    """Curve that friction follows over a path, as bristles do: F' = |v_r| (F_curve - F) / d.

    It is the LuGre law without damping of the bristles, of one deflection d at all speeds.
    """

    name: ClassVar[str] = "lugre"
    curve: Curve
    """Curve in steady slip."""
    deflection: float = 0.0

    @property
    def shaped(self) -> bool:
        """Whether the curve in steady slip has a shape."""
        return self.curve.shaped

    @property
    def least_shape(self) -> float:
        """That of the curve."""
        return self.curve.least_shape

    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return those of the curve; see `Curve.terms`."""
        return self.curve.terms(speed, shape)

    @property
    def least(self) -> Sequence[float]:
        """Those of the curve."""
        return self.curve.least


def followed(terms: FloatArray, path: FloatArray) -> FloatArray:
    """Return terms that friction follows over a path.

    Parameters
    ----------
    terms : array of shape (samples, terms)
        Terms of the curve, with the sign of the slip.
    path : array of shape (samples,)
        Path from the sample before, in deflections.

    Returns
    -------
    array of shape (samples, terms)
        Terms that are late by the path.
    """
    found = np.empty_like(terms)
    state = terms[0]
    for number, (target, kept) in enumerate(zip(terms, np.exp(-path).tolist(), strict=True)):
        state = target + (state - target) * kept
        found[number] = state
    return found
