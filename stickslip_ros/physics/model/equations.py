"""The equations of motion, eq. 5, and of the washout controller, eq. 17 and 18.

They are written once, for floats, arrays and heyoka expressions: a drive may have expressions for
its constants. The integrator of the motion and all derivatives are compiled from them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.physics.model.drive import Drive


def reaction(drive: Drive, position: Any, velocity: Any, force: Any) -> Any:
    """Return h = k x + c x' - u: the friction force that keeps the slide from accelerating."""
    return drive.stiffness * position + drive.damping * velocity - force


def acceleration(drive: Drive, friction_force: Any, reaction: Any) -> Any:
    """Return x'' = (F - h)/m, eq. 5, with the friction force F = N mu(x' - v_belt)."""
    return (friction_force - reaction) / drive.mass


def normal_force(drive: Drive, time: Any, switches: Sequence[Any] = ()) -> Any:
    """Return the normal force N(t), with the load."""
    return drive.normal_force + drive.load.value(time, switches)


def belt_speed(drive: Drive, time: Any, switches: Sequence[Any] = ()) -> Any:
    """Return the speed of the belt v_belt(t)."""
    return drive.belt_speed + drive.belt.value(time, switches)


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

    states: ClassVar[tuple[str, ...]] = ("w",)
    """Names of the states: W of the filter, m."""

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

    def state_rates(self, speed: Any, states: Sequence[Any]) -> tuple[Any, ...]:
        """Return the rates of the states, w' = v, eq. 17.

        Parameters
        ----------
        speed : float, array or expression
            Speed y of the slide.
        states : sequence of float, array or expression
            State w of the filter.

        Returns
        -------
        tuple of float, array or expression
            Rate of w, in the unit of `speed`.
        """
        return (self.filtered(speed, states[0]),)

    def control_force(self, speed: Any, states: Sequence[Any]) -> Any:
        """Return the force without sampling, eq. 17 and 18.

        Parameters
        ----------
        speed : float, array or expression
            Speed y of the slide.
        states : sequence of float, array or expression
            State w of the filter.

        Returns
        -------
        float, array or expression
            Control force u, in the unit of the gains.
        """
        return self.force(self.filtered(speed, states[0]))
