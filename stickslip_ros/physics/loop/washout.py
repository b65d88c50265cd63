"""The washout control law, for measurements at instants that are held in between."""

from dataclasses import dataclass
from functools import cached_property
from math import expm1

from stickslip_ros.physics.model.equations import WashoutGains


@dataclass(frozen=True)
class WashoutParameters:
    """Constants of the washout law in SI units, eq. 17 and 18."""

    corner_frequency: float
    """Cutoff frequency d of the filter, rad/s."""
    linear_gain: float
    """Linear gain k1, N s/m."""
    cubic_gain: float
    """Cubic gain k2, N s^3/m^3."""
    force_limit: float = float("inf")
    """Largest magnitude of the force, N."""
    start_after: float = 0.0
    """Time from the first measurement during which the force is zero, s."""

    @cached_property
    def gains(self) -> WashoutGains:
        """Cutoff frequency and gains."""
        return WashoutGains(self.corner_frequency, self.linear_gain, self.cubic_gain)


class Washout:
    """Washout filter and force, eq. 17 and 18, discretised exactly for a held measurement.

    The filter w' = y - d w, v = y - d w is kept as z = d w, the low-passed speed, z' = d (y - z),
    so that its output does not jump when the cutoff frequency changes.

    Parameters
    ----------
    parameters : WashoutParameters
        Constants of the law.
    low_passed : float, optional
        Low-passed speed z at the first measurement, m/s. By default it is the first measured speed,
        so that the filter starts at rest.

    Examples
    --------
    >>> from stickslip_ros.physics.loop.washout import Washout, WashoutParameters
    >>> washout = Washout(WashoutParameters(20.0, linear_gain=-3000.0, cubic_gain=0.0))
    >>> washout.answer(0, 0.04)
    0.0
    >>> round(washout.answer(1_000_000, 0.05), 3)
    -30.0
    """

    def __init__(self, parameters: WashoutParameters, low_passed: float | None = None) -> None:
        self.parameters = parameters
        """Constants of the law; a new value acts from the next measurement on."""
        self._stamp: int | None = None
        self._first_stamp = 0
        self._velocity = 0.0
        self._older: tuple[int, float] | None = None
        self._begins_with = low_passed
        self.low_passed = 0.0
        """Low-passed speed z at the newest measurement, m/s."""

    def answer(self, stamp: int, velocity: float) -> float | None:
        """Return the control force for a measurement.

        A stamp that was already answered is not answered again. Neither is an older one, unless the
        next measurement continues from it: then time has gone back, and the filter restarts at rest
        from that older one. A filter at rest answers a stamp that is not later than the first: it
        may start a run whose next sample waits for the answer.

        Parameters
        ----------
        stamp : int
            Stamp of the measurement, ns.
        velocity : float
            Velocity of the slide, m/s; finite.

        Returns
        -------
        float or None
            Force, N, not finite if it overflows; None for no answer.
        """
        parameters = self.parameters
        if self._stamp is None:
            self._start(stamp, velocity)
        elif stamp > self._stamp:
            exponent = -parameters.corner_frequency * ((stamp - self._stamp) * 1e-9)
            self.low_passed -= expm1(exponent) * (self._velocity - self.low_passed)
        else:
            return self._answer_older(stamp, velocity, self._stamp)
        self._stamp = stamp
        self._velocity = velocity
        self._older = None
        if (stamp - self._first_stamp) * 1e-9 < parameters.start_after:
            return 0.0
        force = parameters.gains.force(velocity - self.low_passed)
        limit = parameters.force_limit
        if -limit < force < limit:
            return force
        return max(-limit, min(limit, force))

    def _start(self, stamp: int, velocity: float) -> None:
        self._stamp = self._first_stamp = stamp
        self._velocity = velocity
        begins_with, self._begins_with = self._begins_with, None
        self.low_passed = velocity if begins_with is None else begins_with

    def _answer_older(self, stamp: int, velocity: float, newest: int) -> float | None:
        """Answer a measurement that is not later than the newest answered one."""
        first = self._first_stamp
        older, self._older = self._older, None
        # After the beginning, the newest one again is only a measurement that came twice.
        if older and older[0] < stamp and (stamp < newest or older[0] <= first):
            self._start(*older)
            return self.answer(stamp, velocity)
        if stamp == newest:
            return None
        self._older = stamp, velocity
        return Washout(self.parameters).answer(stamp, velocity) if stamp <= first else None
