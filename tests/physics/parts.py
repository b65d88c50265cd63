"""Friction laws and courses of the tests: memory, limits by direction, pieces, corners."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.course import Course
from stickslip_ros.physics.model.friction import FrictionLaw
from stickslip_ros.physics.model.functions import sin


@dataclass(frozen=True)
class Dahl(FrictionLaw):
    """One state: z' = v - S |v| z / static, mu = -S z."""

    name = "dahl"
    states: ClassVar[Mapping[str, str | None]] = {"z": "m"}
    bristle: Any = constant(20.0, "Stiffness S of the contact.", "1/m")

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return -self.static * sign + 0.0 * relative_speed

    def friction(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Any:
        return -self.bristle * memory[0]

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        slowing = self.bristle * sign * relative_speed * memory[0] / self.static
        return (relative_speed - slowing,)

    def memory_at(self, relative_speed: float, sign: float) -> Sequence[float]:
        return (sign * self.static / self.bristle,)


@dataclass(frozen=True)
class OneSided(FrictionLaw):
    """Coulomb friction that is stronger backward than forward."""

    name = "one_sided"
    backward: Any = constant(0.6, "Coefficient of backward slip.", at_least=0.0)

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        forward, backward = 0.5 * (1.0 + sign), 0.5 * (1.0 - sign)
        return backward * self.backward - forward * self.static + 0.0 * relative_speed

    @property
    def limits(self) -> tuple[Any, Any]:
        return self.static, self.backward


@dataclass(frozen=True)
class Swing(Course):
    """Sine."""

    amplitude: float = constant(0.0, "Amplitude.", "value")
    frequency: float = constant(1.0, "Frequency.", "Hz")

    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        return self.amplitude * sin(2.0 * pi * self.frequency * time)
