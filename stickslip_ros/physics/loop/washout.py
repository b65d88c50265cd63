"""The washout control law, for measurements that come at instants and are held in between."""

from dataclasses import dataclass
from functools import cached_property
from math import expm1
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip_ros.physics.model.equations import WashoutGains


@dataclass(frozen=True)
class WashoutParameters:
    """Constants of the law in SI units, eq. 17 and 18."""

    corner_frequency: float
    """Corner frequency d of the filter, rad/s."""
    linear_gain: float
    """k1, N s/m."""
    cubic_gain: float
    """k2, N s^3/m^3."""
    force_limit: float = float("inf")
    """Largest magnitude of the force, N."""
    start_after: float = 0.0
    """Time from the first measurement during which the force is zero, s."""

    @cached_property
    def gains(self) -> "WashoutGains":
        """The corner frequency and the gains."""
        from stickslip_ros.physics.model.equations import WashoutGains  # loads heyoka

        return WashoutGains(self.corner_frequency, self.linear_gain, self.cubic_gain)


class Washout:
    """Washout filter and force, eq. 17 and 18, discretised exactly for a held measurement.

    The filter w' = y - d w, v = y - d w is kept as z = d w, the low-passed speed, z' = d (y - z),
    so that its output does not jump when the corner frequency is changed.
    """

    def __init__(self, parameters: WashoutParameters, low_passed: float | None = None) -> None:
        """Begin with what the filter holds back of the first measurement, m/s; None: all of it."""
        self.parameters = parameters
        """May be replaced at any time; acts from the next measurement on."""
        self._stamp: int | None = None
        self._first_stamp = 0
        self._velocity = 0.0
        self._older: tuple[int, float] | None = None
        self._begins_with = low_passed
        self.low_passed = 0.0
        """What the filter held back of the newest measurement, z, m/s."""

    def answer(self, stamp: int, velocity: float) -> float | None:
        """Return the force (N) for the slide's finite `velocity` (m/s) measured at `stamp` (ns).

        A stamp that was answered already gets None. So does an older one, and the filter goes on,
        unless the next measurement goes on from there: then time has gone back, and the filter
        restarts, at rest, on that older one. One that is no later than the first is answered by a
        filter at rest, for it may begin a run whose next sample waits for the answer. The force is
        not finite where it overflows.
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
        """Answer a measurement that is not later than the newest one answered."""
        first = self._first_stamp
        older, self._older = self._older, None
        # Past the beginning, the newest one again is just a measurement that came twice.
        if older and older[0] < stamp and (stamp < newest or older[0] <= first):
            self._start(*older)
            return self.answer(stamp, velocity)
        if stamp == newest:
            return None
        self._older = stamp, velocity
        return Washout(self.parameters).answer(stamp, velocity) if stamp <= first else None
