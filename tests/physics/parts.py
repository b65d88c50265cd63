"""Friction laws and courses of the tests: memory, limits by direction, pieces, corners."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

import numpy as np

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


@dataclass(frozen=True)
class Ramp(Course):
    """Rises at a constant rate between two corners."""

    switches: ClassVar[Sequence[str]] = ("before", "rising")
    height: float = constant(0.1, "Height.", "value")
    start: float = constant(1.0, "Start.", "s")
    duration: float = constant(2.0, "Duration.", "s")

    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        before, rising = switches
        slope = (time - self.start) / self.duration
        return self.height * (rising * slope + (1.0 - before - rising))

    def margins(self, time: Any, switches: Sequence[Any]) -> Sequence[Any]:
        before, rising = switches
        after = 1.0 - before - rising
        return (before * self.start + rising * (self.start + self.duration) - time
                + after * (1.0 + time),)  # fmt: skip

    def switches_at(self, time: float) -> Sequence[float]:
        if time < self.start:
            return (1.0, 0.0)
        return (0.0, 1.0 if time < self.start + self.duration else 0.0)

    def switches_after(self, margin: int, switches: Sequence[float]) -> Sequence[float]:
        return (0.0, switches[0])


@dataclass(frozen=True)
class Iwan(FrictionLaw):
    """A spring in series with a slider that yields: z' = v until |S z| = static, then 0."""

    name = "iwan"
    states: ClassVar[Mapping[str, str | None]] = {"z": "m"}
    switches: ClassVar[Sequence[str]] = ("yields",)
    spring: Any = constant(5.0, "Stiffness S.", "1/m")

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return -self.static * sign + 0.0 * relative_speed

    def friction(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Any:
        return -self.spring * memory[0]

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        return ((1.0 - switches[0]) * relative_speed,)

    def margins(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        left = self.static - sign * self.spring * memory[0]
        return (switches[0] + (1.0 - switches[0]) * left,)

    def switches_at(
        self, relative_speed: float, sign: float, memory: Sequence[float]
    ) -> Sequence[float]:
        return (1.0 if sign * self.spring * memory[0] >= self.static else 0.0,)

    def switches_after(
        self, margin: int, sign: float, switches: Sequence[float]
    ) -> Sequence[float]:
        return (1.0,)


@dataclass(frozen=True)
class Pieces(FrictionLaw):
    """Falls in a straight line up to a speed, then stays: two pieces."""

    name = "pieces"
    switches: ClassVar[Sequence[str]] = ("fast",)
    corner: Any = constant(0.5, "Speed from which the coefficient is constant.", "m/s")
    drop: Any = constant(0.3, "Share of the coefficient that is lost.")

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        fast = np.abs(relative_speed) >= self.corner
        return self.friction(relative_speed, sign, (), (1.0 * fast,))

    def friction(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Any:
        lost = switches[0] + (1.0 - switches[0]) * sign * relative_speed / self.corner
        return -sign * self.static * (1.0 - self.drop * lost)

    def margins(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        return ((2.0 * switches[0] - 1.0) * (sign * relative_speed - self.corner),)

    def switches_at(
        self, relative_speed: float, sign: float, memory: Sequence[float]
    ) -> Sequence[float]:
        return (1.0 if abs(relative_speed) >= self.corner else 0.0,)

    def switches_after(
        self, margin: int, sign: float, switches: Sequence[float]
    ) -> Sequence[float]:
        return (1.0 - switches[0],)
