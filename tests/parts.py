"""Parts of the tests: friction laws, control laws and an actuator."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import ControlLaw, Reference
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import FrictionLaw
from stickslip_ros.samples import Sample


def lag(time_constant: float) -> Actuator:
    """An actuator that only lags, by a time constant in s."""
    return Actuator(time_constant=time_constant)


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


@dataclass(frozen=True)
class TwoLags:
    """Force k2 b by two states in a row: a' = d (y - a), b' = d (a - b), and k1 y."""

    states: ClassVar[Sequence[str]] = ("a", "b")
    rate: Any
    gain: Any
    lagging: Any

    def scaled(self, drive: Drive) -> "TwoLags":
        unit = drive.normal_force / drive.speed_scale
        return TwoLags(self.rate / drive.angular_frequency, self.gain / unit, self.lagging / unit)

    def silenced(self) -> "TwoLags":
        return TwoLags(self.rate, 0.0, 0.0)

    def rest(self, position: Any, speed: Any) -> Sequence[Any]:
        return speed, speed

    def state_rates(self, position: Any, speed: Any, states: Sequence[Any]) -> Sequence[Any]:
        first, second = states
        return self.rate * (speed - first), self.rate * (first - second)

    def control_force(self, position: Any, speed: Any, states: Sequence[Any]) -> Any:
        return self.gain * speed + self.lagging * states[1]

    def state_scales(self, drive: Drive) -> Sequence[float]:
        return (drive.speed_scale, drive.speed_scale)

    def bound(self, speed: Any) -> Any:
        return np.full(np.shape(speed), np.inf)


@dataclass(frozen=True)
class Switching(ControlLaw):
    """A force that only has the sign of the velocity: not linear, and no equations."""

    name: ClassVar[str] = "switching"
    size: float = constant(0.1, "Size of the force.", "N")

    def respond(
        self, state: tuple[float, ...], elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, tuple[float, ...]]:
        return -float(np.sign(sample.velocity)) * self.size, state
