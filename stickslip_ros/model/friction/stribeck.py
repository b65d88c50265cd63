"""The cubic Stribeck law of the paper (eq. 3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Stribeck(FrictionLaw):
    """Cubic Stribeck law, eq. 3: mu = -mu_s s + a v_r - b v_r^3.

    a = 3 (mu_s - mu_m) / (2 v_m) and b = (mu_s - mu_m) / (2 v_m^3).
    """

    name: ClassVar[str] = "stribeck"
    proportional: ClassVar[Sequence[str]] = ("static", "minimum")

    minimum: Any = constant(0.25, "Smallest kinetic coefficient mu_m.", at_least=0.0)
    minimum_speed: Any = constant(
        0.5, "Relative speed v_m at which the coefficient is smallest.", "m/s", positive=True
    )

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        drop = self.static - self.minimum
        ratio = relative_speed / self.minimum_speed
        return -self.static * sign + drop / 2.0 * (3.0 * ratio - ratio * ratio * ratio)

    @property
    def size_range(self) -> tuple[float, float]:
        """The smallest coefficient; the largest one is infinite."""
        return self.minimum, inf

    def refusal(self) -> str | None:
        """Refuse a smallest coefficient above the static one; see `SteadyFriction.refusal`."""
        return self.above_static("minimum")
