"""The base class of the friction laws."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from math import inf
from typing import Any, ClassVar, Self

import numpy as np

from stickslip_ros.deprecated_names import Renamed


@dataclass(frozen=True)
class FrictionLaw(ABC):
    """Static friction law: the friction coefficient as a function of the relative speed.

    A law is a frozen dataclass of its constants. `coefficient` is written once; it accepts floats,
    numpy arrays and heyoka expressions, and so do the constants.

    Examples
    --------
    A law of your own, with one more constant (add it to `LAWS` to use it in scenarios):

    >>> from dataclasses import dataclass
    >>> from stickslip_ros.physics.model.friction import FrictionLaw
    >>> @dataclass(frozen=True)
    ... class Viscous(FrictionLaw):
    ...     name = "viscous"
    ...     inverse_speed_power = {"viscous": 1}
    ...     viscous: float
    ...
    ...     def coefficient(self, relative_speed, sign):
    ...         return -self.static * sign - self.viscous * relative_speed
    >>> Viscous.constants()
    ('static', 'viscous')
    >>> float(Viscous(static=0.3, viscous=0.5).at_rest(0.1))
    0.35
    """

    name: ClassVar[str]
    """Name of the law in the parameters."""
    inverse_speed_power: ClassVar[dict[str, int]] = {}
    """For each constant that has a dimension, the power n of its unit (s/m)^n."""

    static: Any
    """Static (break-away) coefficient mu_s: the largest |F|/N during stick."""

    @abstractmethod
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return the friction coefficient during slip, mu(v_r) = F/N.

        `sign` is a separate argument so that the branch is smooth up to and beyond v_r = 0, as the
        integrator needs.

        Parameters
        ----------
        relative_speed : float, array or expression
            Speed v_r of the slide relative to the belt, m/s.
        sign : float, array or expression
            sgn(v_r), -1 or 1.

        Returns
        -------
        float, array or expression
            Coefficient with the sign of the force on the slide, dimensionless.
        """

    def at_rest(self, belt_speed: Any) -> Any:
        """Return mu(-v_belt), eq. 6: the coefficient for a slide at rest on a moving belt.

        Parameters
        ----------
        belt_speed : float or array
            Belt speed, m/s.

        Returns
        -------
        float or array
            Coefficient with the sign of the force on the slide, dimensionless.
        """
        return self.coefficient(-belt_speed, -np.sign(belt_speed))

    sudden_speed = Renamed("characteristic_speed")

    def __init_subclass__(cls) -> None:
        if "sudden_speed" in vars(cls):  # a law written for version 0.1
            type.__setattr__(cls, "characteristic_speed", vars(cls)["sudden_speed"])

    @property
    def characteristic_speed(self) -> float:
        """Speed that may change the coefficient by a factor, m/s; infinite for polynomials."""
        return inf

    def scaled(self, speed: float) -> Self:
        """Return the same law with speeds in units of `speed`.

        Parameters
        ----------
        speed : float
            New unit of speed, m/s.

        Returns
        -------
        FrictionLaw
            Law of the same class.
        """
        changes = {
            name: getattr(self, name) * speed**power
            for name, power in self.inverse_speed_power.items()
        }
        return replace(self, **changes)

    @classmethod
    def constants(cls) -> tuple[str, ...]:
        """Return the names of the law's constants.

        Returns
        -------
        tuple of str
            Names in the order of the dataclass fields.
        """
        return tuple(field.name for field in fields(cls))
