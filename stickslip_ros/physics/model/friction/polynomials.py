"""The laws of the paper, polynomials of the speed: Coulomb, linear and cubic Stribeck."""

from dataclasses import dataclass
from math import copysign, inf
from typing import Any, ClassVar

from typing_extensions import override

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

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return -self.static * sign - self.viscous * relative_speed


@dataclass(frozen=True)
class Linear(FrictionLaw):
    """Linear law (Fig. 9 of the paper): mu = -mu_s s + slope v_r; friction decreases with speed.

    Examples
    --------
    >>> from stickslip_ros.physics.model.friction import Linear
    >>> round(Linear(static=0.4, slope=0.45).coefficient(-0.4, -1.0), 3)
    0.22
    """

    name: ClassVar[str] = "linear"

    slope: Any = constant(0.45, "Decrease of the coefficient with relative speed.", "s/m")

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return -self.static * sign + self.slope * relative_speed

    @property
    def size_range(self) -> tuple[float, float]:
        """The static coefficient, and an infinite one in the direction of the slope."""
        ends = sorted([self.static, -copysign(inf, self.slope)])
        return ends[0], ends[1]


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

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        drop = self.static - self.minimum
        ratio = relative_speed / self.minimum_speed
        return -self.static * sign + drop / 2.0 * (3.0 * ratio - ratio * ratio * ratio)

    @property
    def size_range(self) -> tuple[float, float]:
        """The smallest coefficient; the largest one is infinite."""
        return self.minimum, inf

    def refusal(self) -> str | None:
        """Refuse a smallest coefficient above the static one; see `SteadyFriction.refusal`."""
        return self.above_static("minimum")
