"""The drive: a mass on a spring and a damper, pressed onto a moving belt."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi, sqrt
from typing import Self

from stickslip_ros.physics.model.actuator import IDEAL_ACTUATOR, Actuator
from stickslip_ros.physics.model.constants import Scales, scaled
from stickslip_ros.physics.model.course import NO_COURSE, Course
from stickslip_ros.physics.model.friction import FrictionLaw


@dataclass(frozen=True)
class Drive:
    """Feed drive in SI units, eq. 1: m x'' + c x' + k x = N mu(x' - v_belt) + u.

    The scales make it dimensionless, eq. 2: X'' + 2 beta X' + X = mu(X' - v0) + U.
    A drive with m = k = N = 1 is the dimensionless system itself.

    Examples
    --------
    The slide of a machine tool:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> drive = Drive(mass=100.0, damping=200.0, stiffness=1e6, normal_force=1000.0,
    ...               belt_speed=0.04, friction=Stribeck(0.4, 0.25, 0.05))
    >>> drive.angular_frequency
    100.0
    >>> round(1e6 * drive.equilibrium_position, 3)
    258.4
    """

    mass: float
    """Mass m of the slide, kg."""
    damping: float
    """Viscous damping c, N s/m."""
    stiffness: float
    """Stiffness k of the transmission, N/m."""
    normal_force: float
    """Force N that presses the slide onto the belt, N."""
    belt_speed: float
    """Belt (feed) speed v_belt, m/s; positive, negative or zero."""
    friction: FrictionLaw
    """Friction law; its speeds are in m/s."""
    belt: Course = NO_COURSE
    """Course added to the belt speed, m/s."""
    load: Course = NO_COURSE
    """Course added to the normal force, N."""
    actuator: Actuator = IDEAL_ACTUATOR
    """Actuator that exerts the control force."""

    @cached_property
    def angular_frequency(self) -> float:
        """Natural angular frequency w0 = sqrt(k/m), rad/s; the scale of time is 1/w0."""
        return sqrt(self.stiffness / self.mass)

    @property
    def is_dimensionless(self) -> bool:
        """Whether m = k = N = 1: the dimensionless system, whose values have no units."""
        return self.mass == self.stiffness == self.normal_force == 1.0

    @property
    def natural_period(self) -> float:
        """Period of the undamped free vibration, s."""
        return 2.0 * pi / self.angular_frequency

    @cached_property
    def fastest_belt(self) -> float:
        """Largest absolute speed of the belt, m/s; without its course where that has no bounds."""
        low, high = self.belt.bounds
        ends = [self.belt_speed + each for each in (low, high) if isfinite(each)]
        return max(map(abs, ends), default=abs(self.belt_speed))

    @cached_property
    def length_scale(self) -> float:
        """Scale of length L = N/k, m."""
        return self.normal_force / self.stiffness

    @cached_property
    def speed_scale(self) -> float:
        """Scale of speed V = w0 L, m/s."""
        return self.angular_frequency * self.length_scale

    @cached_property
    def scales(self) -> Scales:
        """Units in which the drive is dimensionless."""
        return Scales(self.length_scale, self.speed_scale, self.normal_force)

    @cached_property
    def dimensionless(self) -> Self:
        """The same drive in these units, eq. 2: m = k = N = 1."""
        if self.is_dimensionless:
            return self
        scales = self.scales
        return type(self)(
            mass=1.0,
            damping=self.damping_coefficient,
            stiffness=1.0,
            normal_force=1.0,
            belt_speed=self.belt_speed / self.speed_scale,
            friction=self.friction.scaled(self.speed_scale, self.length_scale),
            belt=scaled(self.belt, scales, "m/s"),
            load=scaled(self.load, scales, "N"),
            actuator=scaled(self.actuator, scales),
        )

    @property
    def equilibrium_position(self) -> float:
        """Displacement of the slide in equilibrium, m, eq. 6.

        With the belt at rest it is one of many possible rest positions.
        """
        return float(self.friction.at_rest(self.belt_speed)) * self.length_scale

    @property
    def damping_coefficient(self) -> float:
        """Dimensionless damping 2 beta = c / sqrt(k m), the coefficient of X'."""
        return self.damping / sqrt(self.stiffness * self.mass)
