"""The cubic Stribeck law of the paper."""

from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Stribeck(FrictionLaw):
    """Cubic Stribeck law, eq. 3: mu = -mu_s s + a v_r - b v_r^3.

    a = 3 (mu_s - mu_m) / (2 v_m) and b = (mu_s - mu_m) / (2 v_m^3).

    Examples
    --------
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> law = Stribeck(static=0.4, minimum=0.25, minimum_speed=0.5)
    >>> law.coefficient(-0.5, -1.0)
    0.25
    """

    name: ClassVar[str] = "stribeck"

    minimum: Any = constant(0.25, "Smallest kinetic coefficient mu_m.", at_least=0.0)
    minimum_speed: Any = constant(
        0.5, "Relative speed v_m at which the coefficient is smallest.", "m/s", positive=True
    )

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r), eq. 3; see `FrictionLaw.coefficient`.

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
        drop = self.static - self.minimum
        ratio = relative_speed / self.minimum_speed
        return -self.static * sign + drop / 2.0 * (3.0 * ratio - ratio * ratio * ratio)

    @property
    def size_range(self) -> tuple[float, float]:
        """The smallest coefficient; the largest one is infinite."""
        return self.minimum, inf

    def refusal(self) -> str | None:
        """Refuse a smallest coefficient above the static one; see `FrictionLaw.refusal`.

        Returns
        -------
        str or None
            Sentence with both values.
        """
        return self.above_static("minimum")
