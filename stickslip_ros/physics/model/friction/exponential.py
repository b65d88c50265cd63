"""The exponential Stribeck law."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.physics.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Exponential(FrictionLaw):
    """Exponential Stribeck law: mu = -s [mu_k + (mu_s - mu_k) exp(-|v_r|/v_s) + mu_v |v_r|].

    It is not in the paper. It is the usual form elsewhere (Armstrong-Helouvry et al., Automatica
    30, 1994, with exponent 1).

    Examples
    --------
    >>> from stickslip_ros.physics.model.friction import Exponential
    >>> law = Exponential(static=0.4, kinetic=0.25, decay_speed=0.5, viscous=0.0)
    >>> round(float(law.coefficient(-0.5, -1.0)), 4)
    0.3052
    """

    name: ClassVar[str] = "exponential"
    inverse_speed_power: ClassVar[dict[str, int]] = {"decay_speed": -1, "viscous": 1}

    kinetic: Any
    """Coulomb coefficient mu_k, the limit at high speed without viscous friction."""
    decay_speed: Any
    """Speed v_s over which the coefficient decays from mu_s to mu_k, m/s."""
    viscous: Any
    """Viscous coefficient mu_v, the increase with speed, s/m."""

    @property
    def characteristic_speed(self) -> float:
        """The decay speed v_s, m/s."""
        return float(self.decay_speed)

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r); see `FrictionLaw.coefficient`.

        Parameters
        ----------
        relative_speed : float, array or expression
            Speed v_r of the slide relative to the belt, m/s.
        sign : float, array or expression
            sgn(v_r), -1 or 1.

        Returns
        -------
        float, array or expression
            Coefficient, dimensionless.
        """
        import heyoka  # what computes with no expressions does not load it

        speed = relative_speed * sign
        exponent = -speed / self.decay_speed
        symbolic = isinstance(exponent, heyoka.expression)
        decay = heyoka.exp(exponent) if symbolic else np.exp(exponent)
        drop = self.static - self.kinetic
        return -sign * (self.kinetic + drop * decay + self.viscous * speed)
