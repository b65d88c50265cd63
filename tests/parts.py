"""Parts of the tests: friction laws, control laws and an actuator."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import ControlLaw, Reference
from stickslip_ros.model.friction import FrictionLaw
from stickslip_ros.samples import Sample


def lag(time_constant: float) -> Actuator:
    """An actuator that only lags, by a time constant in s."""
    return Actuator(time_constant=time_constant)


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
class Switching(ControlLaw):
    """A force that only has the sign of the velocity: not linear, and no equations."""

    name: ClassVar[str] = "switching"
    size: float = constant(0.1, "Size of the force.", "N")

    def respond(
        self, state: tuple[float, ...], elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, tuple[float, ...]]:
        return -float(np.sign(sample.velocity)) * self.size, state
