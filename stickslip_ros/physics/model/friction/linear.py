"""The linear law."""

from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.physics.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Linear(FrictionLaw):
    """Linear law (Fig. 9 of the paper): -mu_s s + slope v_r; friction falls with speed."""

    name: ClassVar[str] = "linear"
    inverse_speed_power: ClassVar[dict[str, int]] = {"slope": 1}

    slope: Any
    """Fall of the coefficient with the relative speed, s/m."""

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r)."""
        return -self.static * sign + self.slope * relative_speed
