"""The exponential law: a Stribeck curve that is not the paper's."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import FrictionLaw
from stickslip_ros.model.functions import exp, power


@dataclass(frozen=True)
class Exponential(FrictionLaw):
    """Exponential Stribeck law: mu = -s [mu_k + (mu_s - mu_k) exp(-(|v_r|/v_s)^n) + mu_v |v_r|].

    It is not in the paper. It is the usual form elsewhere (Armstrong-Helouvry et al., Automatica
    30, 1994). The exponent n is often 1 or 2.
    """

    name: ClassVar[str] = "exponential"
    proportional: ClassVar[Sequence[str]] = ("static", "kinetic", "viscous")

    kinetic: Any = constant(0.25, "Kinetic coefficient mu_k.", at_least=0.0)
    decay_speed: Any = constant(
        0.5, "Speed v_s of the decay from mu_s to mu_k.", "m/s", positive=True
    )
    viscous: Any = constant(0.0, "Increase of the coefficient with speed.", "s/m")
    exponent: Any = constant(
        1.0,
        "Exponent n of the decay from mu_s to mu_k.",
        at_least=1.0,
        at_most=100.0,  # more is nearly a step
        simplifies=True,
    )

    @property
    def characteristic_speed(self) -> float:
        """The decay speed divided by the exponent, v_s/n, m/s."""
        return float(self.decay_speed / self.exponent)

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        speed = relative_speed * sign
        drop = self.static - self.kinetic
        if isinstance(self.exponent, int | float) and self.exponent == 1.0:
            decay = exp(-speed / self.decay_speed)
        else:
            decay = exp(-power(speed / self.decay_speed, self.exponent))
        return -sign * (self.kinetic + drop * decay + self.viscous * speed)

    @property
    def size_range(self) -> tuple[float, float]:
        """The kinetic and the static coefficient; with a viscous part see the base class."""
        return (self.kinetic, self.static) if self.viscous == 0.0 else super().size_range

    def refusal(self) -> str | None:
        """Refuse a kinetic coefficient above the static one; see `SteadyFriction.refusal`."""
        return self.above_static("kinetic")
