"""The drive: a mass on a spring and a damper, pressed onto a moving belt."""

from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt

from stickslip_ros.physics.model.friction import FrictionLaw


@dataclass(frozen=True)
class Drive:
    """A feed drive in SI units, eq. 1: m x'' + c x' + k x = N mu(x' - v_belt) + u.

    The scales make it dimensionless, eq. 2: X'' + 2 beta X' + X = mu(X' - v0) + U.
    A drive with m = k = N = 1 is the dimensionless system itself.
    """

    mass: float
    """Mass m of the slide, kg."""
    damping: float
    """Viscous damping c, N s/m."""
    stiffness: float
    """Stiffness k of the transmission, N/m."""
    normal_force: float
    """Force N pressing slide and belt together, N."""
    belt_speed: float
    """Belt (feed) speed, m/s, of either sign or zero."""
    friction: FrictionLaw
    """Friction law, its speeds in m/s."""

    @cached_property
    def angular_frequency(self) -> float:
        """Natural angular frequency w0 = sqrt(k/m), rad/s: one over the scale of time."""
        return sqrt(self.stiffness / self.mass)

    @property
    def is_dimensionless(self) -> bool:
        """Whether it is the dimensionless system itself, whose figures have no units."""
        return self.mass == self.stiffness == self.normal_force == 1.0

    @property
    def natural_period(self) -> float:
        """Period of the undamped free vibration, s."""
        return 2.0 * pi / self.angular_frequency

    @cached_property
    def length_scale(self) -> float:
        """Scale of length L = N/k, m."""
        return self.normal_force / self.stiffness

    @cached_property
    def speed_scale(self) -> float:
        """Scale of speed V = w0 L, m/s."""
        return self.angular_frequency * self.length_scale

    @property
    def equilibrium_position(self) -> float:
        """Displacement of a slide at rest, m, eq. 6; on a belt at rest it may be any other too."""
        return float(self.friction.at_rest(self.belt_speed)) * self.length_scale

    @property
    def damping_coefficient(self) -> float:
        """Dimensionless damping 2 beta = c / sqrt(k m), the coefficient of X'."""
        return self.damping / sqrt(self.stiffness * self.mass)
