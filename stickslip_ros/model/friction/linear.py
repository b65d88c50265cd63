"""The linear law of the paper."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, inf
from typing import Any, ClassVar

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Linear(FrictionLaw):
    """Linear law (Fig. 9 of the paper): mu = -mu_s s + slope v_r; friction decreases with speed."""

    name: ClassVar[str] = "linear"
    proportional: ClassVar[Sequence[str]] = ("static", "slope")

    slope: Any = constant(0.45, "Decrease of the coefficient with relative speed.", "s/m")

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return -self.static * sign + self.slope * relative_speed

    @property
    def size_range(self) -> tuple[float, float]:
        """The static coefficient, and an infinite one in the direction of the slope."""
        ends = sorted([self.static, -copysign(inf, self.slope)])
        return ends[0], ends[1]
