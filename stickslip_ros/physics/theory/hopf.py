"""Hopf bifurcations: at which belt speeds, how fast the eigenvalues cross, and to which side."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import SPEED, WashoutGains
from stickslip_ros.physics.theory.linear import Expansion, expand, hurwitz_determinants, jacobians
from stickslip_ros.physics.theory.roots import zero_between

_BELT_SPEEDS = np.geomspace(1e-6, 1e3, 4001)
"""Dimensionless speeds between which sign changes are looked for, half a percent apart."""


@dataclass(frozen=True)
class HopfPoint:
    """A belt speed at which a pair of eigenvalues crosses the imaginary axis."""

    belt_speed: float
    """m/s, above zero; the point at the opposite speed mirrors it."""
    angular_frequency: float
    """Imaginary part of the pair, rad/s: the frequency of the vibration that begins here."""
    crossing_speed: float
    """Rate of change of the pair's real part with the belt speed, 1/s per m/s; eq. 11 and 22."""
    first_lyapunov_coefficient: float
    """See `first_lyapunov_coefficient`."""

    @property
    def supercritical(self) -> bool:
        """Whether stable vibrations begin here, small ones first."""
        return self.first_lyapunov_coefficient < 0.0


@dataclass(frozen=True)
class ComplexPair:
    """The complex pair of eigenvalues; of two or three there cannot be another."""

    growth: float
    """Real part."""
    frequency: float
    """Imaginary part, above zero."""
    right: npt.NDArray[np.complex128]
    """q with A q = (growth + i frequency) q."""
    left: npt.NDArray[np.complex128]
    """p with A^T p = (growth - i frequency) p, and p* q = 1."""

    @classmethod
    def from_expansion(cls, expansion: Expansion) -> Self | None:
        """Return the pair of the Jacobian; None if its eigenvalues are real."""
        decomposed: Any = np.linalg.eig(expansion.jacobian)
        values, right = decomposed
        upper = int(np.argmax(values.imag))
        if values[upper].imag <= 0.0:
            return None
        left = np.linalg.inv(right)[upper].conj()
        value = complex(values[upper])
        return cls(value.real, value.imag, right[:, upper], left)


def hopf_points(drive: Drive, gains: WashoutGains | None = None) -> list[HopfPoint]:
    """Return the Hopf points over the belt speed, lowest first.

    Of the open loop, or under continuous control (eq. 19) with `gains` in SI units. Looked for are
    speeds from 1e-6 to 1e3 N/sqrt(k m); two points closer than half a percent may be overlooked.
    """
    margins = _hopf_margins(drive, gains, _BELT_SPEEDS)
    before = np.flatnonzero(np.sign(margins[:-1]) * np.sign(margins[1:]) < 0.0)
    points: list[HopfPoint] = []
    for row in before:
        speed = zero_between(
            lambda v: float(_hopf_margins(drive, gains, np.array([v]))[0]),
            float(_BELT_SPEEDS[row]),
            float(_BELT_SPEEDS[row + 1]),
        )
        at_point = replace(drive, belt_speed=speed * drive.speed_scale)
        expansion = expand(at_point, gains)
        assert expansion is not None
        crossing, sigma = crossing_speed(expansion), first_lyapunov_coefficient(expansion)
        if crossing is None or sigma is None:  # two real eigenvalues of opposite sign
            continue
        points.append(
            HopfPoint(
                belt_speed=at_point.belt_speed,
                angular_frequency=float(expansion.eigenvalues[0].imag) * drive.angular_frequency,
                crossing_speed=crossing * drive.angular_frequency / drive.speed_scale,
                first_lyapunov_coefficient=sigma,
            )
        )
    return points


def first_lyapunov_coefficient(expansion: Expansion) -> float | None:
    """Return sigma of r' = alpha r + sigma r^3, r the amplitude of the dimensionless speed.

    For the expansion at a Hopf point, which is supercritical where sigma is below zero; None if no
    eigenvalues are complex. By projection onto the critical eigenvectors, for any order n:
    Kuznetsov, Elements of Applied Bifurcation Theory, section 5.4. His coefficient is that of the
    amplitude along the eigenvector and is divided by the frequency.
    """
    jacobian, quadratic, cubic = expansion.jacobian, expansion.quadratic, expansion.cubic
    pair = ComplexPair.from_expansion(expansion)
    if pair is None:
        return None
    frequency, q, p = pair.frequency, pair.right, pair.left
    conjugate = q.conj()
    mean = np.linalg.solve(jacobian, np.einsum("ijk,j,k", quadratic, q, conjugate))
    double = np.linalg.solve(
        2j * frequency * np.eye(len(jacobian)) - jacobian, np.einsum("ijk,j,k", quadratic, q, q)
    )
    projected = p.conj() @ (
        np.einsum("ijkl,j,k,l", cubic, q, q, conjugate)
        - 2.0 * np.einsum("ijk,j,k", quadratic, q, mean)
        + np.einsum("ijk,j,k", quadratic, conjugate, double)
    )
    return float(projected.real / (8.0 * abs(q[SPEED]) ** 2))


def crossing_speed(expansion: Expansion) -> float | None:
    """Return d Re(l)/d v0 of the complex pair l, eq. 11 and 22, dimensionless; None without one."""
    pair = ComplexPair.from_expansion(expansion)
    if pair is None:
        return None
    return float((pair.left.conj() @ expansion.jacobian_by_belt_speed @ pair.right).real)


def _hopf_margins(drive: Drive, gains: WashoutGains | None, belt_speeds: FloatArray) -> FloatArray:
    return hurwitz_determinants(jacobians(drive, gains, belt_speeds))[:, -1]
