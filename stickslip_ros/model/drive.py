"""The drive: a mass on a spring and a damper, pressed onto a moving belt."""

from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from math import inf, log2, pi, sqrt
from typing import Any, Self

from typing_extensions import override

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.actuator import IDEAL_ACTUATOR, Actuator
from stickslip_ros.model.constants import Scales, constant, scaled
from stickslip_ros.model.friction import FrictionLaw, Stribeck
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.signals import NO_SIGNAL, Signal
from stickslip_ros.text import quantity

UNBOUNDED_SPEED = 1e3
"""Dimensionless speed of the slide above which the motion counts as unbounded, and ends."""

_USUAL_COEFFICIENTS, _USUAL_COEFFICIENT = (2.0**-10, 2.0**3), 0.4
"""Static coefficients with which the normal force is the unit of force, and the middle of them."""


@dataclass(frozen=True)
class DriveConstants:
    """The constants of a drive itself, in SI units; the plant has them as parameters."""

    mass: float = constant(1.0, "Mass of the slide.", "kg", positive=True)
    damping: float = constant(0.02, "Viscous damping of the transmission.", "N s/m", at_least=0.0)
    stiffness: float = constant(
        1.0,
        "Stiffness of the transmission; 0 for an axis that no spring holds.",
        "N/m",
        at_least=0.0,
    )
    normal_force: float = constant(
        1.0, "Force that presses the slide onto the belt.", "N", positive=True
    )
    belt_speed: float = constant(
        0.4, "Speed of the belt (feed speed), positive or negative.", "m/s"
    )
    _: KW_ONLY
    bias_force: float = constant(
        0.0, "Constant force on the slide, such as an offset.", "N", simplifies=True
    )
    guide_damping: float = constant(
        0.0, "Viscous damping between slide and belt.", "N s/m", at_least=0.0, simplifies=True
    )


@dataclass(frozen=True)
class Drive(DriveConstants):
    """Feed drive in SI units, eq. 1: m x'' + c x' + k x = N mu(x' - v_belt) + u + bias.

    Damping of the guide adds the force -c_g (x' - v_belt). With a `Motor` of finite mass, k and c
    act between slide and motor, and u on the motor.
    The scales make it dimensionless, eq. 2: X'' + 2 beta X' + X = mu(X' - v0) + U.
    Only N mu acts: with coefficients far from usual ones, such as those of N = 1 N, the unit of
    force is another part of the friction. A drive with m = k = N = 1 is the dimensionless system
    itself. Without a spring, k = 0, the term X vanishes, and the unit of speed is 1 m/s.

    Examples
    --------
    The slide of a machine tool:

    >>> from stickslip_ros.model.drive import Drive
    >>> from stickslip_ros.model.friction import Stribeck
    >>> drive = Drive(mass=100.0, damping=200.0, stiffness=1e6, normal_force=1000.0,
    ...               belt_speed=0.04, friction=Stribeck(0.4, 0.25, 0.05))
    >>> drive.angular_frequency
    100.0
    >>> round(1e6 * drive.equilibrium_position, 3)
    258.4
    """

    friction: FrictionLaw = field(default_factory=Stribeck)
    """Friction law; its speeds are in m/s."""
    belt: Signal = NO_SIGNAL
    """Signal added to the belt speed, m/s."""
    load: Signal = NO_SIGNAL
    """Signal added to the normal force, N."""
    actuator: Actuator = IDEAL_ACTUATOR
    """Actuator that exerts the control force."""
    motor: Motor | None = None
    """Motor behind the spring; None for an ideal one, which moves exactly at the feed."""

    @property
    def has_spring(self) -> bool:
        """Whether the stiffness is above zero."""
        return self.stiffness != 0.0

    @cached_property
    def angular_frequency(self) -> float:
        """Scale of rates, rad/s: the natural angular frequency w0 = sqrt(k/m).

        Without a spring it is N/(m V) with the scale of speed V = 1 m/s.
        """
        if not self.has_spring:
            return self.force_scale / self.mass
        return sqrt(self.stiffness / self.mass)

    @property
    def is_dimensionless(self) -> bool:
        """Whether m = k = N = 1: the dimensionless system, whose values have no units."""
        return self.mass == self.stiffness == self.normal_force == 1.0

    @property
    def natural_period(self) -> float:
        """Period of the undamped free vibration, s; infinite without a spring.

        That of slide and motor against each other, if the motor has a mass.
        """
        if self.motor is not None and self.has_spring:
            reduced_mass = 1.0 / (1.0 / self.mass + 1.0 / self.motor.mass)
            return 2.0 * pi / sqrt(self.stiffness / reduced_mass)
        return 2.0 * pi / self.angular_frequency if self.has_spring else inf

    @cached_property
    def fastest_belt(self) -> float:
        """Largest absolute speed of the belt, m/s."""
        return max(abs(self.belt_speed + end) for end in self.belt.bounds)

    @cached_property
    def force_scale(self) -> float:
        """Scale of force, N: N, times a power of two for a law of unusual coefficients."""
        static = float(max(self.friction.limits))
        if static == 0.0 or _USUAL_COEFFICIENTS[0] <= static <= _USUAL_COEFFICIENTS[1]:
            return self.normal_force
        factor = 2.0 ** round(log2(static / _USUAL_COEFFICIENT))
        known = self.friction.multiplied(1.0 / factor) is not None
        return self.normal_force * factor if known else self.normal_force

    @cached_property
    def length_scale(self) -> float:
        """Scale of length L = N/k, m; without a spring V/w0 = m V^2/N."""
        if not self.has_spring:
            return self.mass / self.force_scale
        return self.force_scale / self.stiffness

    @cached_property
    def speed_scale(self) -> float:
        """Scale of speed V = w0 L, m/s; 1 m/s without a spring."""
        if not self.has_spring:
            return 1.0
        return self.angular_frequency * self.length_scale

    @cached_property
    def scales(self) -> Scales:
        """Units in which the drive is dimensionless."""
        return Scales(self.length_scale, self.speed_scale, self.force_scale)

    @cached_property
    def dimensionless(self) -> Self:
        """The same drive in these units, eq. 2: m = k = N = 1, or k = 0 without a spring."""
        if self.is_dimensionless and self.force_scale == 1.0:
            return self
        scales = self.scales
        friction: FrictionLaw | None = self.friction.scaled(scales.speed, scales.length)
        if self.force_scale != self.normal_force:
            friction = friction.multiplied(self.normal_force / self.force_scale)
            assert friction is not None
        return self._scaled(
            mass=1.0,
            damping=self._coefficient(self.damping),
            stiffness=1.0 if self.has_spring else 0.0,
            normal_force=1.0,
            friction=friction,
            load=self.load.scaled(replace(scales, force=self.normal_force), "N"),
        )

    def _scaled(self, **constants: Any) -> Self:
        """Return the drive in its scales, with these values of constants."""
        scales = self.scales
        return replace(
            self,
            belt_speed=self.belt_speed / scales.speed,
            bias_force=self.bias_force / scales.force,
            belt=self.belt.scaled(scales, "m/s"),
            actuator=scaled(self.actuator, scales),
            motor=None if self.motor is None else scaled(self.motor, scales),
            guide_damping=self.guide_damping * scales.factor("N s/m"),
            **constants,
        )

    @property
    def equilibrium_position(self) -> float:
        """Displacement of the slide in equilibrium, m, eq. 6.

        With the belt at rest it is one of many possible rest positions. Of a drive with a motor it
        is that with the motor at the reference. Raises InvalidInputError for a drive without a
        spring, which has none.
        """
        if not self.has_spring:
            raise InvalidInputError(
                "stiffness = 0 N/m: without a spring the slide has no equilibrium position"
            )
        by_friction = float(self.friction.at_rest(self.belt_speed)) * (
            self.normal_force / self.stiffness
        )
        dragged = self.bias_force + self.guide_damping * self.belt_speed
        return by_friction + dragged / self.stiffness

    @property
    def damping_coefficient(self) -> float:
        """Dimensionless damping 2 beta = c / sqrt(k m), the coefficient of X'.

        That of the guide is a part of it. Without a spring it is c V/N.
        """
        return self._coefficient(self.damping + self.guide_damping)

    def _coefficient(self, damping: float) -> float:
        if not self.has_spring:
            return damping / self.force_scale
        return damping / sqrt(self.stiffness * self.mass)


@dataclass(frozen=True)
class ScaledDrive(Drive):
    """Drive whose units are those of another drive: its mass and stiffness need not be 1 in them.

    Durations, lengths and speeds then do not depend on its constants, so that a motion has
    derivatives by all of them.
    """

    unit: Drive = field(kw_only=True)
    """The drive that gives the units; with a spring. Its normal force is the unit of force."""

    @cached_property
    @override
    def angular_frequency(self) -> float:
        return self.unit.angular_frequency

    @cached_property
    @override
    def force_scale(self) -> float:
        return self.unit.normal_force

    @cached_property
    @override
    def length_scale(self) -> float:
        return self.unit.normal_force / self.unit.stiffness

    @cached_property
    @override
    def dimensionless(self) -> Self:
        return self._scaled(
            mass=self.mass / self.unit.mass,
            damping=self.damping * self.scales.speed / self.scales.force,
            stiffness=self.stiffness / self.unit.stiffness,
            normal_force=self.normal_force / self.scales.force,
            friction=self.friction.scaled(self.scales.speed, self.scales.length),
            load=self.load.scaled(self.scales, "N"),
        )


def in_units_of(unit: Drive, drive: Drive) -> ScaledDrive:
    """Return a drive in the units of another one, of the same normal force."""
    parts = {name: getattr(drive, name) for name in Drive.__dataclass_fields__}
    return ScaledDrive(**parts, unit=unit)


def number_text(drive: Drive, value: float, unit: str) -> str:
    """Return a number for a sentence, with its unit, which a dimensionless drive has not."""
    return f"{value:.4g}" if drive.is_dimensionless else quantity(value, unit)
