"""What a friction law must provide."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from math import inf
from typing import Any, ClassVar, Self

import numpy as np

from stickslip_ros.deprecated_names import Renamed


@dataclass(frozen=True)
class FrictionLaw(ABC):
    """A static friction law: the friction coefficient as a function of the relative speed.

    A law is a frozen dataclass of its constants. `coefficient` is written once and serves floats,
    numpy arrays and heyoka expressions alike, the constants being of the same kind.
    """

    name: ClassVar[str]
    inverse_speed_power: ClassVar[dict[str, int]] = {}
    """For each constant that has a dimension, the power n of its unit (s/m)^n."""

    static: Any
    """Static (break-away) coefficient mu_s: the largest |F|/N while the slide rides the belt."""

    @abstractmethod
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r) = F/N on the slide while it slips, `sign` being sgn(v_r).

        `sign` stands apart so that the branch stays smooth, and can be followed by an
        integrator, up to and beyond v_r = 0.
        """

    def at_rest(self, belt_speed: Any) -> Any:
        """Return mu(-v_belt), eq. 6: what carries a slide at rest on a belt that is not."""
        return self.coefficient(-belt_speed, -np.sign(belt_speed))

    sudden_speed = Renamed("characteristic_speed")

    def __init_subclass__(cls) -> None:
        if "sudden_speed" in vars(cls):  # a law written for version 0.1
            type.__setattr__(cls, "characteristic_speed", vars(cls)["sudden_speed"])

    @property
    def characteristic_speed(self) -> float:
        """Speed within which the coefficient may change by a factor; infinite for polynomials."""
        return inf

    def scaled(self, speed: float) -> Self:
        """Return the same law with speeds measured in units of `speed` (m/s)."""
        changes = {
            name: getattr(self, name) * speed**power
            for name, power in self.inverse_speed_power.items()
        }
        return replace(self, **changes)

    @classmethod
    def constants(cls) -> tuple[str, ...]:
        """Return the names of the law's constants, in the order of the dataclass."""
        return tuple(field.name for field in fields(cls))
