"""The Coulomb law."""

from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """Coulomb law (Fig. 8 of the paper), with viscous friction: mu = -s (mu_s + mu_v |v_r|).

    Examples
    --------
    >>> from stickslip_ros.physics.model.friction import Coulomb
    >>> Coulomb(static=0.4).coefficient(-0.3, -1.0)
    0.4
    """

    name: ClassVar[str] = "coulomb"

    viscous: Any = constant(0.0, "Increase of the coefficient with speed.", "s/m", simplifies=True)

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
        return -self.static * sign - self.viscous * relative_speed
