"""The equations of motion, eq. 5 and 19 of the paper, as symbolic expressions.

Everything is dimensionless (see `Drive`). The integrator of the motion is compiled from these
expressions; whatever needs derivatives of the right-hand side takes them from these too.
"""

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import FrictionLaw

X, Y, W = hy.make_vars("x", "y", "w")
"""Displacement X, speed Y = X' and, under continuous control, the state W of the washout filter."""

SPEED = 1
"""Where Y stands in a state."""


@dataclass(frozen=True)
class WashoutGains:
    """Corner frequency and gains of a washout controller, eq. 17 and 18."""

    corner_frequency: Any
    """Corner frequency d of the filter."""
    linear: Any
    """Linear gain k1."""
    cubic: Any
    """Cubic gain k2."""

    def scaled(self, drive: Drive) -> "WashoutGains":
        """Return in dimensionless form what is given in SI units."""
        return WashoutGains(
            self.corner_frequency / drive.angular_frequency,
            self.linear * drive.speed_scale / drive.normal_force,
            self.cubic * drive.speed_scale**3 / drive.normal_force,
        )

    def filtered(self, speed: Any, state: Any) -> Any:
        """Return the filter's output v = y - d w, eq. 17."""
        return speed - self.corner_frequency * state

    def force(self, filtered: Any) -> Any:
        """Return the force u = k1 v + k2 v^3, eq. 18."""
        return self.linear * filtered + self.cubic * filtered * filtered * filtered


class Equations:
    """Right-hand sides while slipping and while sticking, for one friction law.

    Constants are runtime parameters (`heyoka.par`) of what is compiled from them; `parameters`
    gives their values for a drive.

    With `continuous_control` the force is that of the washout controller, eq. 19, and the filter
    state W is a third variable; otherwise it is a parameter, held by whoever integrates.
    """

    def __init__(self, law: type[FrictionLaw], continuous_control: bool) -> None:
        self.continuous_control = continuous_control
        names = ["damping", "belt_speed", "force", "sign", "corner_frequency", "linear", "cubic"]
        names += law.constants()
        self.index = {name: number for number, name in enumerate(names)}
        """Where each parameter stands in the integrator's array of parameters."""
        par = {name: hy.par[number] for name, number in self.index.items()}

        gains = WashoutGains(par["corner_frequency"], par["linear"], par["cubic"])
        filtered = gains.filtered(Y, W)
        force = gains.force(filtered) if continuous_control else par["force"]
        friction = law(*[par[name] for name in law.constants()])

        self.relative_speed = Y - par["belt_speed"]
        """v_r = X' - v0."""
        self.reaction = X + par["damping"] * Y - force
        """h = X + 2 beta X' - U: the friction that an unaccelerated slide needs."""
        self.acceleration = friction.coefficient(self.relative_speed, par["sign"]) - self.reaction
        """X'' while slipping, eq. 5: mu(X' - v0) - 2 beta X' - X + U."""
        self.sign = par["sign"]
        self.static = par["static"]

        filter_equation = [(W, filtered)] if continuous_control else []
        self.slip = [(X, Y), (Y, self.acceleration), *filter_equation]
        """Slipping with sgn(v_r) = sign."""
        self.stick = [(X, Y), (Y, 0.0 * Y), *filter_equation]
        """Sticking: the slide rides the belt, so its speed stays what it is."""

    def parameters(self, drive: Drive) -> dict[str, float]:
        """Return the values of the drive's parameters: damping, belt speed and the law's."""
        law = drive.friction.scaled(drive.speed_scale)
        return {
            "damping": drive.damping_coefficient,
            "belt_speed": drive.belt_speed / drive.speed_scale,
            **{name: float(getattr(law, name)) for name in law.constants()},
        }
