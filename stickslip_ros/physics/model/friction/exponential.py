"""The exponential Stribeck law."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.physics.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Exponential(FrictionLaw):
    """Exponential Stribeck law: -s [mu_k + (mu_s - mu_k) exp(-|v_r|/v_s) + mu_v |v_r|].

    Not in the paper; the form that is usual elsewhere (Armstrong-Helouvry et al., Automatica 30,
    1994, with exponent 1).
    """

    name: ClassVar[str] = "exponential"
    inverse_speed_power: ClassVar[dict[str, int]] = {"decay_speed": -1, "viscous": 1}

    kinetic: Any
    """Coulomb coefficient mu_k, approached at high speed."""
    decay_speed: Any
    """Speed v_s over which the static coefficient decays, m/s."""
    viscous: Any
    """Viscous rise mu_v of the coefficient with speed, s/m."""

    @property
    def characteristic_speed(self) -> float:
        """The decay speed."""
        return float(self.decay_speed)

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r)."""
        import heyoka  # what computes with no expressions does not load it

        speed = relative_speed * sign
        exponent = -speed / self.decay_speed
        symbolic = isinstance(exponent, heyoka.expression)
        decay = heyoka.exp(exponent) if symbolic else np.exp(exponent)
        drop = self.static - self.kinetic
        return -sign * (self.kinetic + drop * decay + self.viscous * speed)
