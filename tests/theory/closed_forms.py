"""Closed forms for the cubic Stribeck law; the general theory must agree with them.

Everything is dimensionless (see `Drive`) and for v0 > 0. With mu = -mu_s s + a v_r - b v_r^3
(eq. 3) and the damping coefficient 2 beta, the slope of the acceleration over the speed is
p = a - 2 beta - 3 b v0^2 (eq. 8), and the quadratic term of the friction is 3 b v0 Y^2 (eq. 9).
"""

from dataclasses import dataclass
from math import sqrt
from typing import Self

from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Stribeck


@dataclass(frozen=True)
class CubicLoop:
    """Drive with the cubic Stribeck law, by its dimensionless coefficients."""

    static: float
    """Static coefficient mu_s."""
    slope: float
    """Coefficient a of eq. 3."""
    cubic: float
    """Coefficient b of eq. 3."""
    damping: float
    """Damping coefficient 2 beta."""
    belt_speed: float
    """Belt speed v0, above zero."""

    @classmethod
    def from_drive(cls, drive: Drive) -> Self:
        """Return the coefficients of a drive with this law, whose belt moves."""
        law = drive.dimensionless.friction
        assert isinstance(law, Stribeck)
        drop = law.static - law.minimum
        return cls(
            static=law.static,
            slope=3.0 * drop / (2.0 * law.minimum_speed),
            cubic=drop / (2.0 * law.minimum_speed**3),
            damping=drive.damping_coefficient,
            belt_speed=abs(drive.belt_speed) / drive.speed_scale,
        )

    @property
    def equilibrium(self) -> float:
        """Equilibrium X, eq. 6: mu_s - a v0 + b v0^3."""
        return self.static - self.slope * self.belt_speed + self.cubic * self.belt_speed**3

    @property
    def trace(self) -> float:
        """Trace p of the Jacobian, eq. 8."""
        return self.slope - self.damping - 3.0 * self.cubic * self.belt_speed**2

    @property
    def hopf_speed(self) -> float | None:
        """v_b1 = sqrt((a - 2 beta) / (3 b)), where p = 0; None if the damping is too large."""
        if self.slope <= self.damping or self.cubic == 0.0:
            return None
        return sqrt((self.slope - self.damping) / (3.0 * self.cubic))

    @property
    def crossing_speed(self) -> float | None:
        """Slope d Re(l)/d v0 = -3 b v_b1 at the Hopf speed, eq. 11."""
        return None if self.hopf_speed is None else -3.0 * self.cubic * self.hopf_speed

    @property
    def first_lyapunov_coefficient(self) -> float:
        """First Lyapunov coefficient sigma = -3 b / 8 of the open loop, eq. 15."""
        return -3.0 * self.cubic / 8.0

    @property
    def sticking_onset(self) -> float | None:
        """v_b0 = sqrt(4/5) v_b1: by averaging, the speed amplitude reaches the belt speed."""
        return None if self.hopf_speed is None else sqrt(0.8) * self.hopf_speed

    def critical_linear_gain(self, corner_frequency: float) -> float | None:
        """Return the critical linear gain k1* = d - p - d / (1 - p d), from eq. 21."""
        d, p = corner_frequency, self.trace
        return None if p * d >= 1.0 else d - p - d / (1.0 - p * d)

    def critical_lyapunov_coefficient(self, corner_frequency: float, cubic: float) -> float | None:
        """Return sigma of the closed loop at its critical linear gain.

        By harmonic balance. With H = s / (s + d), the loop is D(s) y = s N(y) with
        D = s^2 + 1 - s (p + k1 H) and N = 3 b v0 y^2 - b y^3 + k2 (H y)^3. At first order
        y = r cos(w t), w^2 = 1 - p d. The square drives the second harmonic. Its beat with the
        first harmonic and the cubes make up the slow change of r.
        """
        terms = self._critical_lyapunov_terms(corner_frequency)
        return None if terms is None else terms[0] + cubic * terms[1]

    def critical_cubic_gain(self, corner_frequency: float) -> float | None:
        """Return the cubic gain at which `critical_lyapunov_coefficient` changes sign."""
        terms = self._critical_lyapunov_terms(corner_frequency)
        return None if terms is None else -terms[0] / terms[1]

    def _critical_lyapunov_terms(self, corner_frequency: float) -> tuple[float, float] | None:
        """Return the contributions of the friction and of a cubic gain of one."""
        linear = self.critical_linear_gain(corner_frequency)
        if linear is None:
            return None
        d, p = corner_frequency, self.trace
        s = 1j * sqrt(1.0 - p * d)
        washout = s / (s + d)
        slope = 2.0 * s - p - linear * s * (s + 2.0 * d) / (s + d) ** 2  # dD/ds
        double = 4.0 * s * s + 1.0 - 2.0 * s * (p + linear * 2.0 * s / (2.0 * s + d))  # D(2 s)
        square = 3.0 * self.cubic * self.belt_speed
        friction = s / slope * (s * square**2 / double - 0.75 * self.cubic)
        control = s / slope * 0.75 * abs(washout) ** 2 * washout
        return friction.real, control.real
