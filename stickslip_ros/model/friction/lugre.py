"""The LuGre law, and the base of all laws whose contact follows a static law."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import exp
from typing import Any, ClassVar, Self

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import FrictionLaw, Numbers, Values
from stickslip_ros.model.friction.exponential import Exponential
from stickslip_ros.model.friction.stiction import Stiction

LEAST_SIZE = 1e-12
"""Least coefficient at which bristles yield."""


def bristle_stiffness() -> Any:
    """Describe the constant of this name."""
    return constant(
        1000.0, "Stiffness S of the contact, per unit of normal force.", "1/m", positive=True
    )


def deflection_after(
    law: FrictionLaw, relative_speed: float, deflection: float, duration: float
) -> float:
    """Return z after a duration at a constant speed, with z' = v_r (1 - s z / |z_steady|)."""
    (steady,) = law.memory_at(relative_speed, 1.0 if relative_speed > 0.0 else -1.0)
    path = abs(relative_speed) * duration
    return steady + (deflection - steady) * exp(-path / abs(steady))


@dataclass(frozen=True)
class SteadyPart(FrictionLaw):
    """The friction of another law in steady slip, its curve, as a law without a memory."""

    static: ClassVar[Any]  # type: ignore[misc]
    proportional: ClassVar[Sequence[str]] = ()

    curve: FrictionLaw = field(default_factory=Exponential)
    """Law that gives the friction in steady slip."""

    @property
    def static(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The static coefficient of the curve."""
        return self.curve.static

    @property
    def limits(self) -> tuple[Any, Any]:
        """The limits of the curve."""
        return self.curve.limits

    @property
    def characteristic_speed(self) -> float:
        """That of the curve, m/s."""
        return self.curve.characteristic_speed

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return that of the curve; see `SteadyFriction.coefficient`."""
        return self.curve.coefficient(relative_speed, sign)

    @override
    def multiplied(self, factor: float) -> Self | None:
        """Return the same law, and its curve, with another size; see `FrictionLaw.multiplied`."""
        law, curve = super().multiplied(factor), self.curve.multiplied(factor)
        return None if law is None or curve is None else replace(law, curve=curve)

    def scaled(self, speed: float, length: float = 1.0) -> Self:
        """Return the same law, and its curve, in other units; see `FrictionLaw.scaled`."""
        return replace(super().scaled(speed, length), curve=self.curve.scaled(speed, length))


@dataclass(frozen=True)
class CurveFollower(SteadyPart):
    """Law with a memory that has the friction of a static law in steady slip: its curve.

    The size of the curve without its viscous part, g(v_r), limits the memory. The viscous part acts
    immediately. Switches and margins of the curve, such as those of the pieces of a table, follow
    the law's own.
    """

    direction_independent: ClassVar[Sequence[str]] = ("bristle_stiffness",)
    own_switches: ClassVar[Sequence[str]] = ()
    """Switches of the law itself."""

    bristle_stiffness: Any = bristle_stiffness()

    def __post_init__(self) -> None:
        object.__setattr__(self, "switches", (*self.own_switches, *self.curve.switches))

    def size(self, relative_speed: Any, sign: Any, switches: Values) -> Any:
        """Return g(v_r), dimensionless.

        Parameters
        ----------
        relative_speed : float or expression
            Speed v_r of the slide relative to the belt, m/s.
        sign : float or expression
            sgn(v_r), -1 or 1.
        switches : sequence of float or expression
            Values of `switches`.

        Returns
        -------
        float or expression
            Size of the curve without its viscous part.
        """
        curve_switches = switches[len(self.own_switches) :]
        return -sign * self._dry.friction(relative_speed, sign, (), curve_switches)

    @property
    def viscous_part(self) -> Any:
        """Increase of the coefficient with speed that acts immediately, s/m."""
        return getattr(self.curve, "viscous", 0.0)

    def margins(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Values:
        """Return those of the curve, with the switches of all; see `FrictionMemory.margins`."""
        count = len(self.own_switches)
        return self._dry.margins(relative_speed, sign, (), switches[count:])

    def switches_at(self, relative_speed: float, sign: float, memory: Numbers) -> Numbers:
        """Return those of the curve only; see `FrictionMemory.switches_at`."""
        return self.curve.switches_at(relative_speed, sign, ())

    def switches_after(self, margin: int, sign: float, switches: Numbers) -> Numbers:
        """Return all switches after a margin of the curve; see `FrictionMemory.switches_after`."""
        count = len(self.own_switches)
        return (*switches[:count], *self.curve.switches_after(margin, sign, switches[count:]))

    def refusal(self) -> str | None:
        """Refuse a curve with a memory or stiction, or one that is not above 0 everywhere."""
        name = self.curve.name
        if self.curve.states:
            return f"curve = {name} must be a static law: it has a memory"
        if (refusal := self.curve.refusal()) is not None:
            return refusal
        if isinstance(self.curve, Stiction):
            return f"curve = {name} must be a law whose friction does not fall where slip starts"
        least, _ = self._dry.size_range
        if least >= LEAST_SIZE:
            return None
        return (
            f"curve = {name} must be at least {LEAST_SIZE:g} at every speed: without its viscous "
            f"part it falls to {least}"
        )

    @cached_property
    def _dry(self) -> FrictionLaw:
        return self.curve.dry


@dataclass(frozen=True)
class LuGre(CurveFollower):
    """LuGre law: z' = v_r - S |v_r| z / g(v_r), mu = -(S z + D z' + mu_v v_r).

    z is the mean deflection of the bristles of the contact. C. Canudas de Wit, H. Olsson,
    K. J. Astrom, P. Lischinsky, A new model for control of systems with friction, IEEE
    Transactions on Automatic Control 40(3), 1995. g and mu_v are those of `curve`.

    A load with a bias below break-away drifts with every cycle, as with Dahl's law; real contacts
    do not. The law is passive only if mu_v > D (max g / min g - 1) (N. Barabanov, R. Ortega, IEEE
    Transactions on Automatic Control 45(4), 2000).
    """

    name: ClassVar[str] = "lugre"
    proportional: ClassVar[Sequence[str]] = ("bristle_stiffness", "bristle_damping")
    states: ClassVar[Mapping[str, str | None]] = {"z": "m"}

    bristle_damping: Any = constant(
        30.0, "Damping D of the contact, per unit of normal force.", "s/m", at_least=0.0
    )

    def friction(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Any:
        """Return -(S z + D z' + mu_v v_r); see `FrictionMemory.friction`."""
        (rate,) = self.memory_rates(relative_speed, sign, memory, switches)
        elastic = self.bristle_stiffness * memory[0] + self.bristle_damping * rate
        return -(elastic + self.viscous_part * relative_speed)

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Values, switches: Values
    ) -> Values:
        """Return z'; see `FrictionMemory.memory_rates`."""
        size = self.size(relative_speed, sign, switches)
        share = self.bristle_stiffness * memory[0] / size
        return (relative_speed - sign * relative_speed * share,)

    def memory_at(self, relative_speed: float, sign: float) -> Numbers:
        """Return s g / S; see `FrictionMemory.memory_at`."""
        steady = self._dry.coefficient(relative_speed, sign)
        return (-float(steady) / self.bristle_stiffness,)

    def memory_after(
        self, relative_speed: float, memory: Numbers, switches: Numbers, duration: float
    ) -> Numbers:
        """Return z, which approaches that of steady slip; see `FrictionMemory.memory_after`."""
        return (deflection_after(self, relative_speed, memory[0], duration),)

    def warning(self) -> str | None:
        """Say that the law is not passive, if so; see `SteadyFriction.warning`."""
        low, high = self._dry.size_range
        excess = high / low - 1.0
        margin = self.viscous_part - (self.bristle_damping * excess if excess > 0.0 else 0.0)
        if margin > 0.0 or self.bristle_damping == 0.0:
            return None
        return (
            f"friction law {self.name} is not passive, and may supply energy: viscous = "
            f"{self.viscous_part:g} s/m is {-margin:.4g} s/m below "
            "bristle_damping * (max g / min g - 1)"
        )
