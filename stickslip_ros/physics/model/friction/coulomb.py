"""The Coulomb law."""

from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.physics.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """Coulomb law (Fig. 8 of the paper): -mu_s s, whatever the speed."""

    name: ClassVar[str] = "coulomb"

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r)."""
        return -self.static * sign + 0.0 * relative_speed
