"""The generalised Maxwell-slip law."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp
from typing import Any, ClassVar

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import Numbers, Values
from stickslip_ros.model.friction.lugre import CurveFollower

_AT_LIMIT = 1.0 - 2.0**-40
"""Share of its limit from which an element slips at the start of a mode, as in steady slip."""


@dataclass(frozen=True)
class MaxwellSlip(CurveFollower):
    """Maxwell-slip law (GMS): mu = -(sum S_i z_i + mu_v v_r), n elements that stick or slip.

    An element of weight 1/n that sticks has z_i' = v_r, until s S_i z_i = g(v_r)/n. Then it slips
    with S_i z_i' = C (s/n - S_i z_i / g(v_r)) until v_r changes its sign. The stiffnesses S_i add
    up to S; element i yields at i/n of the deflection of the last one. F. Al-Bender, V. Lampaert,
    J. Swevers, The generalized Maxwell-slip model, IEEE Transactions on Automatic Control 50(11),
    2005. g and mu_v are those of `curve`.

    Its presliding hysteresis does not depend on the rate, and closes whatever the bias: no drift.
    Friction lags behind a change of the speed by g/C. There is no damping of the contact.
    """

    name: ClassVar[str] = "maxwell_slip"
    proportional: ClassVar[Sequence[str]] = ("bristle_stiffness", "attraction")
    states: ClassVar[Mapping[str, str | None]] = {"z1": "m", "z2": "m", "z3": "m", "z4": "m"}

    elements: Any = constant(
        4, "Number n of elements of the contact.", at_least=1, at_most=20, whole=True
    )
    attraction: Any = constant(
        100.0, "Rate C at which the elements approach steady slip.", "1/s", positive=True
    )

    def __post_init__(self) -> None:
        numbers = range(1, self.elements + 1)
        object.__setattr__(self, "states", {f"z{number}": "m" for number in numbers})
        object.__setattr__(self, "own_switches", tuple(f"slips{number}" for number in numbers))
        super().__post_init__()

    @property
    def stiffnesses(self) -> Values:
        """S_i of each element, 1/m."""
        return [self.bristle_stiffness * share for share in self._shares]

    @property
    def _shares(self) -> Sequence[float]:
        """Share of each element in the stiffness."""
        numbers = range(1, self.elements + 1)
        total = sum(1.0 / number for number in numbers)
        return [1.0 / (number * total) for number in numbers]

    # In a flow a constant times a variable costs little: the order of the factors matters.
    def friction(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Any:
        """Return -(sum S_i z_i + mu_v v_r); see `FrictionMemory.friction`."""
        stretches = [share * z for share, z in zip(self._shares, memory, strict=True)]
        force = self.bristle_stiffness * sum(stretches[1:], stretches[0])
        return -(force + self.viscous_part * relative_speed)

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Values, switches: Values
    ) -> Values:
        """Return z_i'; see `FrictionMemory.memory_rates`."""
        inverse = 1.0 / self.size(relative_speed, sign, switches)
        limit = sign * (1.0 / self.bristle_stiffness)
        rates: list[Any] = []
        for share, z, slips in zip(self._shares, memory, switches, strict=False):
            slipping = self.attraction * (limit * (1.0 / (self.elements * share)) - z * inverse)
            rates.append(relative_speed + slips * (slipping - relative_speed))
        return rates

    def margins(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Values:
        """Return those of the elements from their limits; see `FrictionMemory.margins`."""
        size = self.size(relative_speed, sign, switches)
        from_limits = [size - sign * force for force in self._forces(memory)]
        margins = [
            margin + slips * (1.0 - margin)
            for margin, slips in zip(from_limits, switches, strict=False)
        ]
        return (*margins, *super().margins(relative_speed, sign, memory, switches))

    def switches_at(self, relative_speed: float, sign: float, memory: Numbers) -> Numbers:
        """Return which elements are at their limit; see `FrictionMemory.switches_at`."""
        of_curve = super().switches_at(relative_speed, sign, memory)
        size = float(self.size(relative_speed, sign, (*[0.0] * self.elements, *of_curve)))
        slipping = [float(sign * force >= _AT_LIMIT * size) for force in self._forces(memory)]
        return (*slipping, *of_curve)

    def switches_after(self, margin: int, sign: float, switches: Numbers) -> Numbers:
        """Return those with one more element that slips; see `FrictionMemory.switches_after`."""
        if margin >= self.elements:
            return super().switches_after(margin - self.elements, sign, switches)
        return (*switches[:margin], 1.0, *switches[margin + 1 :])

    def memory_at(self, relative_speed: float, sign: float) -> Numbers:
        """Return s g / (n S_i); see `FrictionMemory.memory_at`."""
        steady = -float(self._dry.coefficient(relative_speed, sign)) / self.elements
        return [steady / stiffness for stiffness in self.stiffnesses]

    def switches_following(
        self, switches: Numbers, relative_speed: float, sign: float, memory: Numbers
    ) -> Numbers:
        """Keep the elements that slip; see `FrictionMemory.switches_following`."""
        reached, count = self.switches_at(relative_speed, sign, memory), self.elements
        return (*map(max, switches[:count], reached[:count]), *reached[count:])

    def memory_after(
        self, relative_speed: float, memory: Numbers, switches: Numbers, duration: float
    ) -> Numbers:
        """Return z_i, each as it sticks and then slips; see `FrictionMemory.memory_after`."""
        sign = 1.0 if relative_speed > 0.0 else -1.0
        size = abs(float(self._dry.coefficient(relative_speed, sign)))
        after: list[float] = []
        for stiffness, z, slips in zip(self.stiffnesses, memory, switches, strict=False):
            limit = sign * size / self.elements / stiffness
            path = 0.0 if slips else max(sign * (limit - z), 0.0)
            if abs(relative_speed) * duration <= path:
                after.append(z + relative_speed * duration)
                continue
            slipping = duration - path / abs(relative_speed)
            start = z + sign * path
            after.append(limit + (start - limit) * exp(-self.attraction * slipping / size))
        return after

    def _forces(self, memory: Values) -> Values:
        """Return the force of each element in shares of its weight."""
        return [
            self.bristle_stiffness * (self.elements * share * z)
            for share, z in zip(self._shares, memory, strict=True)
        ]
