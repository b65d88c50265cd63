"""The elasto-plastic law."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import Numbers, Values
from stickslip_ros.model.friction.lugre import LuGre
from stickslip_ros.model.functions import sin

_STEP = 0.02
"""Step, in steady deflections, of the deflection at a constant speed."""
_LONGEST_PATH = 40.0
"""Path, in steady deflections, after which the deflection is steady."""


@dataclass(frozen=True)
class ElastoPlastic(LuGre):
    """Elasto-plastic law: z' = v_r (1 - alpha s z / z_ss), mu and z_ss = g(v_r)/S as in LuGre.

    alpha is 0 up to the deflection z_b = `break_away` min g / S and 1 from z_ss on; between them it
    is (1 + sin(pi (s z - (z_ss + z_b)/2)/(z_ss - z_b)))/2. P. Dupont, V. Hayward, B. Armstrong,
    F. Altpeter, Single state elastoplastic friction models, IEEE Transactions on Automatic Control
    47(5), 2002.

    Below z_b the contact is elastic, so that it does not drift. In steady slip it has the friction
    of LuGre, and a first derivative, but no second one.
    """

    name: ClassVar[str] = "elasto_plastic"
    proportional: ClassVar[Sequence[str]] = ("bristle_stiffness", "bristle_damping")
    nonsmooth: ClassVar[bool] = True
    own_switches: ClassVar[Sequence[str]] = ("elastic", "plastic", "limit")

    break_away: Any = constant(
        0.7,
        "Deflection up to which the contact is elastic, as a share of the smallest steady one.",
        at_least=0.0,
        below=1.0,
    )

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Values, switches: Values
    ) -> Values:
        """Return z'; see `FrictionMemory.memory_rates`."""
        elastic, plastic, limit, *_ = switches
        size = self.size(relative_speed, sign, switches)
        force = sign * self.bristle_stiffness * memory[0]
        angle = pi * (force - 0.5 * (size + limit)) / (size - limit)
        yields = plastic + (1.0 - elastic - plastic) * (0.5 + 0.5 * sin(angle))
        return (relative_speed * (1.0 - yields * force / size),)

    def margins(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Values:
        """Return the distances to the ends of a changing alpha; see `FrictionMemory.margins`."""
        elastic, plastic, limit, *_ = switches
        size = self.size(relative_speed, sign, switches)
        force = sign * self.bristle_stiffness * memory[0]
        return (
            plastic + (1.0 - plastic) * (1.0 - 2.0 * elastic) * (force - limit),
            elastic + (1.0 - elastic) * (1.0 - 2.0 * plastic) * (size - force),
            *super().margins(relative_speed, sign, memory, switches),
        )

    def switches_at(self, relative_speed: float, sign: float, memory: Numbers) -> Numbers:
        """Return if it is elastic, if plastic, and S z_b; see `FrictionMemory.switches_at`."""
        of_curve = super().switches_at(relative_speed, sign, memory)
        size = float(self.size(relative_speed, sign, (0.0, 0.0, 0.0, *of_curve)))
        limit = self.break_away * self._dry.size_range[0]
        force = sign * self.bristle_stiffness * memory[0]
        return (float(force <= limit), float(force >= size), limit, *of_curve)

    def switches_after(self, margin: int, sign: float, switches: Numbers) -> Numbers:
        """Return the switches on the other side of an end; see `FrictionMemory.switches_after`."""
        elastic, plastic, *others = switches
        if margin > 1:
            return super().switches_after(margin - 2, sign, switches)
        return (1.0 - elastic, 0.0, *others) if margin == 0 else (0.0, 1.0 - plastic, *others)

    def memory_after(
        self, relative_speed: float, memory: Numbers, switches: Numbers, duration: float
    ) -> Numbers:
        """Return z by Runge-Kutta steps along the path; see `FrictionMemory.memory_after`."""
        if relative_speed == 0.0 or duration == 0.0:
            return memory
        sign = 1.0 if relative_speed > 0.0 else -1.0
        (steady,) = self.memory_at(relative_speed, sign)
        left = abs(relative_speed) * duration
        # Elastic up to the limit, whatever the length of the path.
        limit = sign * self.break_away * self._dry.size_range[0] / self.bristle_stiffness
        z = memory[0]
        elastic = min(left, max(sign * (limit - z), 0.0))
        z, left = z + sign * elastic, left - elastic
        left = min(left, _LONGEST_PATH * abs(steady))

        def slope(z: float) -> float:
            switches = self.switches_at(relative_speed, sign, (z,))
            return float(self.memory_rates(relative_speed, sign, (z,), switches)[0]) * per_path

        per_path = 1.0 / abs(relative_speed)
        while left > 0.0:
            step = min(left, _STEP * abs(steady))
            first = slope(z)
            second = slope(z + 0.5 * step * first)
            third = slope(z + 0.5 * step * second)
            fourth = slope(z + step * third)
            z += step * (first + 2.0 * second + 2.0 * third + fourth) / 6.0
            left -= step
        return (z,)

    def warning(self) -> str | None:
        """Say nothing: the condition of LuGre is not one of this law."""
        return None
