"""The motion and its derivatives by the state at its start."""

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import RunError
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import SPEED, WashoutGains
from stickslip_ros.physics.motion.integrator import Integrator
from stickslip_ros.physics.motion.motion import Motion

_GREATEST_EFFORT = 8e6
"""Limit of slip time times stiffness, dimensionless, for a motion: some seconds of work."""


class TooStiffError(Exception):
    """Raised when a motion takes too many steps; it does not depend on the speed of the machine."""


class SensitiveMotion(Motion):
    """Motion with the derivatives of its state by the state at its start.

    The state is dimensionless: (X, Y), or (X, Y, W) with continuous control. During a slip or a
    stick heyoka integrates the variational equations along with the motion. At the transitions
    the derivatives jump by the saltation matrix (Leine and Nijmeijer, Dynamics and Bifurcations of
    Non-Smooth Mechanical Systems, 2004, ch. 7). Breakpoints are recorded. `advance` raises
    TooStiffError when the integration becomes too costly, summed over all starts.
    """

    _with_derivatives = True

    def __init__(self, drive: Drive, gains: WashoutGains | None = None) -> None:
        """Start at rest at X = 0, with continuous control if `gains` (SI) are given."""
        super().__init__(drive, 0.0, 0.0, continuous_control=gains is not None, record=True)
        if gains is not None:
            self.set_gains(gains.corner_frequency, gains.linear, gains.cubic)
        self._effort = 0.0
        self.start(np.zeros(self.order))

    @property
    def order(self) -> int:
        """Number of components of the state."""
        return 3 if self._continuous_control else 2

    @property
    def state(self) -> FloatArray:
        """X, Y and, with continuous control, W."""
        return np.array([self._x, self._y, self._w][: self.order])

    @property
    def rate(self) -> FloatArray:
        """Derivative of the state by dimensionless time."""
        filtered = self._gains.filtered(self._y, self._w)
        return np.array([self._y, self._acceleration(self._sign), filtered][: self.order])

    def start(self, state: FloatArray) -> None:
        """Start again at `state`, at time zero and without breakpoints."""
        self.take_breakpoints()
        self._time = self._breakpoint_time = 0.0
        self.restart(state[0] * self.drive.length_scale, state[SPEED] * self.drive.speed_scale)
        if self._continuous_control:
            self._w = float(state[2])
        self.transition: FloatArray = np.eye(self.order)
        """Derivatives of the state (rows) by the state at the start (columns)."""
        self.landed = False
        """Whether the slide has stuck since the start."""

    def _propagate(
        self, integrator: Integrator, now: float, end: float
    ) -> tuple[int | None, float]:
        # Start from the identity: heyoka's error is relative to the largest of the variables.
        derivatives = integrator.state[self.order :].reshape(self.order, self.order)
        derivatives[:] = np.eye(self.order)
        try:
            found = super()._propagate(integrator, now, end)
        except RunError:
            raise TooStiffError from None
        self.transition = derivatives @ self.transition
        return found

    def _slip(self, now: float, end: float) -> float:
        sign, start = self._sign, now
        now = super()._slip(now, min(end, now + 30.0))
        self._effort += (now - start) * (1.0 + self._stiffness(sign))
        if self._effort > _GREATEST_EFFORT:
            raise TooStiffError
        if self._sign != sign:
            # I + (f_after - f_before) n^T / (n^T f_before), n along Y, where only Y' jumps. When
            # the slide leaves the belt nothing jumps.
            after = self._acceleration(self._sign)
            self.transition[SPEED] *= after / self._acceleration(sign) if after != 0.0 else 0.0
            self.landed |= self.sticking
        return now

    def _stiffness(self, sign: float) -> float:
        """Return |dX''/dX'| during slip with sgn(v_r) = `sign`."""
        step = 1e-30j  # imaginary, so that nothing cancels
        law = self._drive.friction.scaled(self._drive.speed_scale)
        friction = law.coefficient(self._y - self._belt_speed + step, sign)
        control = self._gains.force(self._gains.filtered(self._y, self._w) + step)
        return abs((friction + control).imag / step.imag - self._damping)

    def _acceleration(self, sign: float) -> float:
        """Return X'' during slip with sgn(v_r) = `sign`, or during stick (0)."""
        if sign == 0.0:
            return 0.0
        relative_speed = (self._y - self._belt_speed) * self._drive.speed_scale
        return float(self._drive.friction.coefficient(relative_speed, sign)) - self._reaction()
