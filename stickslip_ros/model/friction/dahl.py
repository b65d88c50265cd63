"""Dahl's law."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.model.friction.base import FrictionLaw, Numbers, Values
from stickslip_ros.model.friction.lugre import LEAST_SIZE, bristle_stiffness, deflection_after


@dataclass(frozen=True)
class Dahl(FrictionLaw):
    """Dahl's law: z' = v_r - S |v_r| z / mu_s, mu = -S z.

    The contact is a spring that yields, so that friction lags behind a change of direction.
    P. Dahl, A Solid Friction Model, Aerospace Corporation TOR-0158(3107-18)-1, 1968.

    Steady friction is mu_s at every speed: no falling part, and therefore no vibration by itself.
    Friction depends on the path and not on time: a load below break-away does not creep, but every
    cycle of a load with a bias leaves a drift.
    """

    name: ClassVar[str] = "dahl"
    proportional: ClassVar[Sequence[str]] = ("static", "bristle_stiffness")
    states: ClassVar[Mapping[str, str | None]] = {"z": "m"}
    direction_independent: ClassVar[Sequence[str]] = ("bristle_stiffness",)

    bristle_stiffness: Any = bristle_stiffness()

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r) = -mu_s s in steady slip; see `SteadyFriction.coefficient`."""
        return -self.static * sign + 0.0 * relative_speed

    def friction(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Any:
        """Return -S z; see `FrictionMemory.friction`."""
        return -self.bristle_stiffness * memory[0]

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Values, switches: Values
    ) -> Values:
        """Return z'; see `FrictionMemory.memory_rates`."""
        share = self.bristle_stiffness * memory[0] / self.static
        return (relative_speed - sign * relative_speed * share,)

    def memory_at(self, relative_speed: float, sign: float) -> Numbers:
        """Return s mu_s / S; see `FrictionMemory.memory_at`."""
        return (sign * self.static / self.bristle_stiffness,)

    def memory_after(
        self, relative_speed: float, memory: Numbers, switches: Numbers, duration: float
    ) -> Numbers:
        """Return z, which approaches that of steady slip; see `FrictionMemory.memory_after`."""
        return (deflection_after(self, relative_speed, memory[0], duration),)

    def refusal(self) -> str | None:
        """Refuse a coefficient of zero; see `SteadyFriction.refusal`."""
        if self.static >= LEAST_SIZE:
            return None
        return f"static = {self.static} must be at least {LEAST_SIZE:g} for law {self.name}"
