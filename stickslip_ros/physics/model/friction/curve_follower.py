"""The laws whose contact is a spring that yields; the base of those that follow a static law."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import exp
from typing import Any, ClassVar, Self

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.friction.base import FrictionLaw
from stickslip_ros.physics.model.friction.exponential import Exponential

LEAST_SIZE = 1e-12
"""Least coefficient at which bristles yield."""


def bristle_stiffness() -> Any:
    """Describe the constant of this name."""
    return constant(
        1000.0, "Stiffness S of the contact, per unit of normal force.", "1/m", positive=True
    )


def approached(deflection: float, steady: float, path: float) -> float:
    """Return the deflection after a path (m), with z' = v_r (1 - s z / |steady|)."""
    return steady + (deflection - steady) * exp(-path / abs(steady))


@dataclass(frozen=True)
class CurveFollower(FrictionLaw):
    """Law with a memory that has the friction of a static law in steady slip: its curve.

    The size of the curve without its viscous part, g(v_r), limits the memory. The viscous part acts
    immediately. Switches of the curve, such as the pieces of a table, follow those of the law.
    """

    direction_independent: ClassVar[Sequence[str]] = ("bristle_stiffness",)
    own_switches: ClassVar[Sequence[str]] = ()
    """Switches of the law itself."""
    static: ClassVar[Any]  # type: ignore[misc]

    curve: FrictionLaw = field(default_factory=Exponential)
    """Static law that the law follows in steady slip."""
    bristle_stiffness: Any = bristle_stiffness()

    def __post_init__(self) -> None:
        object.__setattr__(self, "switches", (*self.own_switches, *self.curve.switches))

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
        """Return that of the curve; see `FrictionLaw.coefficient`."""
        return self.curve.coefficient(relative_speed, sign)

    def size(self, relative_speed: Any, sign: Any, switches: Sequence[Any]) -> Any:
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
        own = switches[len(self.own_switches) :]
        return -sign * self._dry.friction(relative_speed, sign, (), own)

    @property
    def viscous_part(self) -> Any:
        """Increase of the coefficient with speed that acts immediately, s/m."""
        return getattr(self.curve, "viscous", 0.0)

    def margins(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        """Return those of the law itself and of the curve; see `FrictionLaw.margins`."""
        own = len(self.own_switches)
        return (
            *self._own_margins(relative_speed, sign, memory, switches),
            *self._dry.margins(relative_speed, sign, (), switches[own:]),
        )

    def _own_margins(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        """Return the margins of the law itself, one for each of `own_switches` or fewer."""
        return ()

    def switches_at(
        self, relative_speed: float, sign: float, memory: Sequence[float]
    ) -> Sequence[float]:
        """Return those of the law itself and of the curve; see `FrictionLaw.switches_at`."""
        of_curve = self.curve.switches_at(relative_speed, sign, ())
        own: Sequence[float] = (0.0,) * len(self.own_switches)
        if own:
            size = self.size(relative_speed, sign, (*own, *of_curve))
            own = self._own_switches_at(sign, memory, float(size))
        return (*own, *of_curve)

    def _own_switches_at(
        self, sign: float, memory: Sequence[float], size: float
    ) -> Sequence[float]:
        """Return the switches of the law itself in a state; `size` is g(v_r)."""
        return ()

    def switches_after(
        self, margin: int, sign: float, switches: Sequence[float]
    ) -> Sequence[float]:
        """Return the switches after a margin of either; see `FrictionLaw.switches_after`."""
        count = len(self.own_switches)
        own, of_curve = switches[:count], switches[count:]
        further = margin - self._own_margin_count
        if further >= 0:
            return (*own, *self.curve.switches_after(further, sign, of_curve))
        return (*self._own_switches_after(margin, own), *of_curve)

    def _own_switches_after(self, margin: int, switches: Sequence[float]) -> Sequence[float]:
        """Return the switches of the law itself after one of its margins."""
        return switches

    def refusal(self) -> str | None:
        """Refuse a curve with a memory, or one that is not above 0; see `FrictionLaw.refusal`."""
        name = self.curve.name
        if self.curve.states:
            return f"curve = {name} must be a static law: it has a memory"
        refusal = self.curve.refusal()
        if refusal is not None:
            return refusal
        least, _ = self._dry.size_range
        if least >= LEAST_SIZE:
            return None
        return (
            f"curve = {name} must be at least {LEAST_SIZE:g} at every speed: without its viscous "
            f"part it falls to {least}"
        )

    def scaled(self, speed: float, length: float = 1.0) -> Self:
        """Return the same law, and its curve, in other units; see `FrictionLaw.scaled`."""
        return replace(super().scaled(speed, length), curve=self.curve.scaled(speed, length))

    @cached_property
    def _dry(self) -> FrictionLaw:
        return self.curve.dry

    @cached_property
    def _own_margin_count(self) -> int:
        memory, own = (0.0,) * len(self.states), (0.0,) * len(self.switches)
        return len(self._own_margins(0.0, 1.0, memory, own))
