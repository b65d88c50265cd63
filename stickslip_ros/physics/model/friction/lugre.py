"""The LuGre law."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.friction.curve_follower import CurveFollower, approached


@dataclass(frozen=True)
class LuGre(CurveFollower):
    """LuGre law: z' = v_r - S |v_r| z / g(v_r), mu = -(S z + D z' + mu_v v_r).

    z is the mean deflection of the bristles of the contact. C. Canudas de Wit, H. Olsson,
    K. J. Astrom, P. Lischinsky, A new model for control of systems with friction, IEEE
    Transactions on Automatic Control 40(3), 1995. g and mu_v are those of `curve`.

    A load with a bias below break-away drifts with every cycle, as with Dahl's law; real contacts
    do not. The law is passive only if mu_v > D (max g / min g - 1) (N. Barabanov, R. Ortega, IEEE
    Transactions on Automatic Control 45(4), 2000).

    Examples
    --------
    >>> from stickslip_ros.physics.model.friction import Exponential, LuGre
    >>> curve = Exponential(static=0.4, kinetic=0.25, decay_speed=0.05)
    >>> law = LuGre(curve, bristle_stiffness=1000.0, bristle_damping=0.0)
    >>> float(law.friction(0.0, 1.0, (2e-4,), ()))
    -0.2
    """

    name: ClassVar[str] = "lugre"
    states: ClassVar[Mapping[str, str | None]] = {"z": "m"}

    bristle_damping: Any = constant(
        30.0, "Damping D of the contact, per unit of normal force.", "s/m", at_least=0.0
    )

    def friction(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Any:
        """Return -(S z + D z' + mu_v v_r); see `FrictionLaw.friction`."""
        (rate,) = self.memory_rates(relative_speed, sign, memory, switches)
        elastic = self.bristle_stiffness * memory[0] + self.bristle_damping * rate
        return -(elastic + self.viscous_part * relative_speed)

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        """Return z'; see `FrictionLaw.memory_rates`."""
        size = self.size(relative_speed, sign, switches)
        share = self.bristle_stiffness * memory[0] / size
        return (relative_speed - sign * relative_speed * share,)

    def memory_at(self, relative_speed: float, sign: float) -> Sequence[float]:
        """Return s g / S; see `FrictionLaw.memory_at`."""
        steady = self._dry.coefficient(relative_speed, sign)
        return (-float(steady) / self.bristle_stiffness,)

    def memory_after(
        self,
        relative_speed: float,
        memory: Sequence[float],
        switches: Sequence[float],
        duration: float,
    ) -> Sequence[float]:
        """Return z, which approaches that of steady slip; see `FrictionLaw.memory_after`."""
        (steady,) = self.memory_at(relative_speed, 1.0 if relative_speed > 0.0 else -1.0)
        return (approached(memory[0], steady, abs(relative_speed) * duration),)

    def warning(self) -> str | None:
        """Say that the law is not passive, if so; see `FrictionLaw.warning`."""
        margin = self.passivity_margin
        if margin > 0.0 or self.bristle_damping == 0.0:
            return None
        return (
            f"friction law {self.name} is not passive, and may supply energy: viscous = "
            f"{self.viscous_part:g} s/m is {-margin:.4g} s/m below "
            "bristle_damping * (max g / min g - 1)"
        )

    @property
    def passivity_margin(self) -> float:
        """mu_v - D (max g / min g - 1), s/m: above zero the law is passive, see the class."""
        low, high = self._dry.size_range
        excess = high / low - 1.0
        return self.viscous_part - (self.bristle_damping * excess if excess > 0.0 else 0.0)
