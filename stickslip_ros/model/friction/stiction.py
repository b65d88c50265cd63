"""Coulomb friction with stiction."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Stiction(FrictionLaw):
    """Coulomb friction with stiction: mu = -s (mu_k + mu_v |v_r|), from rest after mu_s.

    It is not in the paper. It is the textbook law, with static above kinetic friction (H. Olsson et
    al., Friction models and friction compensation, European Journal of Control 4, 1998).
    """

    name: ClassVar[str] = "stiction"
    proportional: ClassVar[Sequence[str]] = ("static", "kinetic", "viscous")

    kinetic: Any = constant(0.25, "Kinetic coefficient mu_k.", at_least=0.0)
    viscous: Any = constant(0.0, "Increase of the coefficient with speed.", "s/m", simplifies=True)

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return -self.kinetic * sign - self.viscous * relative_speed

    def refusal(self) -> str | None:
        """Refuse a kinetic coefficient above the static one; see `SteadyFriction.refusal`."""
        return self.above_static("kinetic")
