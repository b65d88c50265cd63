"""The washout control law, eq. 17 and 18: without sampling, and for held samples."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import expm1
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.control.base import ControlLaw, LinearFeedback, State
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.samples import Reference, Sample


@dataclass(frozen=True)
class WashoutGains:
    """Cutoff frequency and gains of a washout controller, eq. 17 and 18.

    The equations are written once, for floats, arrays and heyoka expressions, in SI units or
    dimensionless (see `scaled`).

    Examples
    --------
    >>> from stickslip_ros.physics.model.control import WashoutGains
    >>> gains = WashoutGains(corner_frequency=20.0, linear=-3000.0, cubic=0.0)
    >>> gains.force(0.01)
    -30.0
    """

    states: ClassVar[Sequence[str]] = ("w",)
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

    def silenced(self) -> "WashoutGains":
        """Return the filter alone, which gives no force."""
        return replace(self, linear=0.0, cubic=0.0)

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

    def rest(self, position: Any, speed: Any) -> Sequence[Any]:
        """Return the state of a filter without output, w = y/d.

        Parameters
        ----------
        position, speed : float, array or expression
            Displacement x and speed y of the slide.

        Returns
        -------
        sequence of float, array or expression
            State w.
        """
        return (speed / self.corner_frequency,)

    def state_rates(self, position: Any, speed: Any, states: Sequence[Any]) -> Sequence[Any]:
        """Return the rates of the states, w' = v, eq. 17.

        Parameters
        ----------
        position, speed : float, array or expression
            Displacement x and speed y of the slide.
        states : sequence of float, array or expression
            State w of the filter.

        Returns
        -------
        sequence of float, array or expression
            Rate of w, in the unit of `speed`.
        """
        return (self.filtered(speed, states[0]),)

    def control_force(self, position: Any, speed: Any, states: Sequence[Any]) -> Any:
        """Return the force without sampling, eq. 17 and 18.

        Parameters
        ----------
        position, speed : float, array or expression
            Displacement x and speed y of the slide.
        states : sequence of float, array or expression
            State w of the filter.

        Returns
        -------
        float, array or expression
            Control force u, in the unit of the gains.
        """
        return self.force(self.filtered(speed, states[0]))

    def state_scales(self, drive: Drive) -> Sequence[float]:
        """Return the factor from W, dimensionless, to z = d w, the state of the sampled law.

        Parameters
        ----------
        drive : Drive
            Drive that defines the scales.

        Returns
        -------
        sequence of float
            One factor, m/s.
        """
        return (self.corner_frequency / drive.angular_frequency * drive.speed_scale,)

    def linear_feedback(self, period: float) -> LinearFeedback:
        """Return the sampled controller near the equilibrium: z' = z + q (y - z), u = k1 (y - z).

        Parameters
        ----------
        period : float
            Sample period T, s; q = 1 - exp(-d T).

        Returns
        -------
        LinearFeedback
            Controller with the one state z.
        """
        step, gain = -expm1(-self.corner_frequency * period), self.linear
        return LinearFeedback(
            np.array([[1.0 - step]]),
            np.array([[0.0, step]]),
            np.array([-gain]),
            np.array([0.0, gain]),
        )

    def bound(self, speed: Any) -> Any:
        """Return forces on the speed that give a cycle at least the energy of the controller.

        With v = w' and d w the parts of y that pass the filter and do not, both periodic,
        int v w = 0: int v y = int v^2 <= int y^2. Where k2 < 0, by Young's inequality
        -int v^3 y = -int (v^4 + v^3 d w) <= (27/256) int (d w)^4 <= (27/256) int y^4.
        Otherwise, by Hoelder's, int v^3 y <= 8 int y^4, since v is at most twice as large as y in
        L^4.

        Parameters
        ----------
        speed : ndarray
            Speeds y.

        Returns
        -------
        ndarray
            Forces, shape of `speed`.
        """
        cubic = -27.0 / 256.0 * self.cubic if self.cubic < 0.0 else 8.0 * self.cubic
        return max(self.linear, 0.0) * speed + cubic * speed**3


@dataclass(frozen=True)
class Washout(ControlLaw):
    """Washout filter with linear and cubic velocity feedback, eq. 17 and 18.

    For held samples the filter w' = y - d w, v = y - d w is discretised exactly. Its state is kept
    as z = d w, the low-passed speed, z' = d (y - z), so that its output does not jump when the
    cutoff frequency changes. The filter starts at rest.

    Examples
    --------
    >>> from stickslip_ros.physics.loop.controller import Controller
    >>> from stickslip_ros.physics.model.control import Washout
    >>> from stickslip_ros.samples import Reference, Sample
    >>> washout = Controller(Washout(corner_frequency=20.0, linear_gain=-3000.0, cubic_gain=0.0))
    >>> sample = Sample(0, 0.0, 0.04, 0.0, 0.0, 0.04)
    >>> washout.answer(sample)
    0.0
    >>> round(washout.answer(sample._replace(stamp=1_000_000, velocity=0.05)), 3)
    -30.0
    """

    name: ClassVar[str] = "washout"
    state_units: ClassVar[Mapping[str, str | None]] = {"low_passed": "m/s", "velocity": "m/s"}

    corner_frequency: float = constant(
        2.0, "Cutoff frequency d of the filter.", "rad/s", positive=True
    )
    """Cutoff frequency d of the filter, rad/s."""
    linear_gain: float = constant(-1.0, "Linear gain k1; a negative gain removes energy.", "N s/m")
    """Linear gain k1, N s/m."""
    cubic_gain: float = constant(-1.0, "Cubic gain k2.", "N s^3/m^3")
    """Cubic gain k2, N s^3/m^3."""

    @cached_property
    def gains(self) -> WashoutGains:
        """Cutoff frequency and gains."""
        return WashoutGains(self.corner_frequency, self.linear_gain, self.cubic_gain)

    @property
    def continuous(self) -> WashoutGains:
        """The law without sampling, eq. 19."""
        return self.gains

    def initial_state(self, sample: Sample, reference: Reference) -> State:
        """Return a filter at rest: the low-passed speed, and the speed that is held.

        Parameters
        ----------
        sample : Sample
            First sample.
        reference : Reference
            Not used.

        Returns
        -------
        tuple of float
            Low-passed speed z and held velocity y, m/s.
        """
        return sample.velocity, sample.velocity

    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        """Return the force for a sample, and the state after it; see `ControlLaw.respond`.

        Parameters
        ----------
        state : tuple of float
            Low-passed speed z and held velocity y, m/s.
        elapsed : float
            Time since the last sample, s.
        sample : Sample
            Sample to answer.
        reference : Reference
            Not used.

        Returns
        -------
        force : float
            Control force, N.
        state : tuple of float
            State after the sample.
        """
        low_passed, held = state
        velocity = sample.velocity
        if elapsed > 0.0:
            low_passed -= expm1(-self.corner_frequency * elapsed) * (held - low_passed)
        return self.gains.force(velocity - low_passed), (low_passed, velocity)

    def linear_feedback(self, period: float) -> LinearFeedback:
        """Return the law near the equilibrium; see `WashoutGains.linear_feedback`.

        Parameters
        ----------
        period : float
            Sample period T, s.

        Returns
        -------
        LinearFeedback
            Law with the one state z.
        """
        return self.gains.linear_feedback(period)
