"""The equations of motion, eq. 5 and 19 of the paper, as symbolic expressions.

Everything is dimensionless (see `Drive`). The integrator of the motion is compiled from these
expressions. The derivatives of the right-hand side are derived from them, too.
"""

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import FrictionLaw

X, Y, W = hy.make_vars("x", "y", "w")
"""Displacement X, speed Y = X' and, with continuous control, the state W of the washout filter."""

SPEED = 1
"""Index of Y in a state."""


@dataclass(frozen=True)
class WashoutGains:
    """Cutoff frequency and gains of a washout controller, eq. 17 and 18.

    The values are floats, numpy arrays or heyoka expressions, in SI units or dimensionless (see
    `scaled`).

    Examples
    --------
    >>> from stickslip_ros.physics.model.equations import WashoutGains
    >>> gains = WashoutGains(corner_frequency=20.0, linear=-3000.0, cubic=0.0)
    >>> gains.force(0.01)
    -30.0
    """

    corner_frequency: Any
    """Cutoff frequency d of the filter, rad/s."""
    linear: Any
    """Linear gain k1, N s/m."""
    cubic: Any
    """Cubic gain k2, N s^3/m^3."""

    def scaled(self, drive: Drive) -> "WashoutGains":
        """Convert from SI units to dimensionless values.

        Parameters
        ----------
        drive : Drive
            Drive that defines the scales.

        Returns
        -------
        WashoutGains
            The same controller, dimensionless.
        """
        return WashoutGains(
            self.corner_frequency / drive.angular_frequency,
            self.linear * drive.speed_scale / drive.normal_force,
            self.cubic * drive.speed_scale**3 / drive.normal_force,
        )

    def filtered(self, speed: Any, state: Any) -> Any:
        """Return the output of the washout filter, v = y - d w, eq. 17.

        Parameters
        ----------
        speed : float, array or expression
            Speed y of the slide.
        state : float, array or expression
            State w of the filter.

        Returns
        -------
        float, array or expression
            Filter output v, in the unit of `speed`.
        """
        return speed - self.corner_frequency * state

    def force(self, filtered: Any) -> Any:
        """Return the control force, u = k1 v + k2 v^3, eq. 18.

        Parameters
        ----------
        filtered : float, array or expression
            Filter output v.

        Returns
        -------
        float, array or expression
            Force u, N for gains and speed in SI units.
        """
        return self.linear * filtered + self.cubic * filtered * filtered * filtered


class Equations:
    """Right-hand sides for slip and for stick, for one friction law.

    The constants are runtime parameters (`heyoka.par`) of the compiled expressions; `parameters`
    returns their values for a drive.

    With `continuous_control` the force is that of the washout controller, eq. 19, and the filter
    state W is a third variable. Otherwise the force is a parameter, which the integration holds
    constant.
    """

    def __init__(self, law: type[FrictionLaw], continuous_control: bool) -> None:
        self.continuous_control = continuous_control
        names = ["damping", "belt_speed", "force", "sign", "corner_frequency", "linear", "cubic"]
        names += law.constants()
        self.index = {name: number for number, name in enumerate(names)}
        """Index of each parameter in the integrator's array of parameters."""
        par = {name: hy.par[number] for name, number in self.index.items()}

        gains = WashoutGains(par["corner_frequency"], par["linear"], par["cubic"])
        filtered = gains.filtered(Y, W)
        force = gains.force(filtered) if continuous_control else par["force"]
        friction = law(*[par[name] for name in law.constants()])

        self.relative_speed = Y - par["belt_speed"]
        """v_r = X' - v0."""
        self.reaction = X + par["damping"] * Y - force
        """h = X + 2 beta X' - U: the friction needed to keep the slide from accelerating."""
        self.acceleration = friction.coefficient(self.relative_speed, par["sign"]) - self.reaction
        """X'' during slip, eq. 5: mu(X' - v0) - 2 beta X' - X + U."""
        self.sign = par["sign"]
        self.static = par["static"]

        filter_equation = [(W, filtered)] if continuous_control else []
        self.slip = [(X, Y), (Y, self.acceleration), *filter_equation]
        """Slip with sgn(v_r) = sign."""
        self.stick = [(X, Y), (Y, 0.0 * Y), *filter_equation]
        """Stick: the slide moves with the belt, so its speed is constant."""

    def parameters(self, drive: Drive) -> dict[str, float]:
        """Return the parameter values of a drive: damping, belt speed and the law's constants."""
        law = drive.friction.scaled(drive.speed_scale)
        return {
            "damping": drive.damping_coefficient,
            "belt_speed": drive.belt_speed / drive.speed_scale,
            **{name: float(getattr(law, name)) for name in law.constants()},
        }
