"""The Coulomb law of the paper."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """Coulomb law (Fig. 8 of the paper), with viscous friction: mu = -s (mu_s + mu_v |v_r|)."""

    name: ClassVar[str] = "coulomb"
    proportional: ClassVar[Sequence[str]] = ("static", "viscous")

    viscous: Any = constant(0.0, "Increase of the coefficient with speed.", "s/m", simplifies=True)

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return -self.static * sign - self.viscous * relative_speed
