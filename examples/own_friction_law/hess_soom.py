"""The friction law of Hess and Soom, for `stickslip_ros`, and how it is identified."""

from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

from stickslip_ros.identification.identified_law import IdentifiedLaw
from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction import FrictionLaw


@dataclass(frozen=True)
class HessSoom(FrictionLaw):
    """Law of Hess and Soom: -s [mu_k + (mu_s - mu_k) / (1 + (v_r/v_s)^2) + mu_v |v_r|].

    Hess and Soom, Journal of Tribology 112, 1990, p. 147: lubricated line contacts.
    """

    name: ClassVar[str] = "hess_soom"

    kinetic: Any = constant(0.25, "Kinetic coefficient mu_k.", at_least=0.0)
    decay_speed: Any = constant(0.5, "Speed v_s at half of the decay.", "m/s", positive=True)
    viscous: Any = constant(0.0, "Increase of the coefficient with speed.", "s/m")

    @property
    def characteristic_speed(self) -> float:
        """The decay speed, m/s."""
        return float(self.decay_speed)

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r), for floats, arrays and symbols."""
        ratio = relative_speed / self.decay_speed
        drop = (self.static - self.kinetic) / (1.0 + ratio * ratio)
        return -sign * (self.kinetic + drop + self.viscous * relative_speed * sign)

    def refusal(self) -> str | None:
        """Refuse a kinetic coefficient above the static one."""
        return self.above_static("kinetic")


class IdentifiedHessSoom(IdentifiedLaw):
    """F = F_k + D / (1 + (w/v_s)^2) + F_v w with three unknown forces and the shape v_s."""

    name = "hess_soom"
    least = 0.0, 0.0, -inf
    shaped = True
    coordinates = "kinetic", "rise", "decay_speed", "viscous"
    unscaled = ("decay_speed",)
    smallest = "kinetic"
