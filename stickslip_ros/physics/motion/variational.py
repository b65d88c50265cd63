"""The motion and its derivatives by the state at its start."""

from collections.abc import Sequence
from dataclasses import replace
from math import copysign

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import RunError
from stickslip_ros.physics.model.actuator import IDEAL_ACTUATOR
from stickslip_ros.physics.model.control import ContinuousControl
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import MEMORY, SLIP, SPEED
from stickslip_ros.physics.model.hybrid import Mode
from stickslip_ros.physics.motion.compiled_flow import Detail, flow_rates, parameter_values
from stickslip_ros.physics.motion.recorded_motion import RecordedMotion

_GREATEST_EFFORT = 8e6
"""Limit of slip time times stiffness, dimensionless, for a motion: some seconds of work."""

_EFFORT_OF_A_STEP = 7.0
"""Time of a step, times the stiffness that limits it."""

_LONGEST_SLIP = 30.0
"""Dimensionless time after which the effort of a slip is added up."""


class TooStiffError(Exception):
    """Raised when a motion takes too many steps; it does not depend on the speed of the machine."""


class SensitiveMotion(RecordedMotion):
    """Motion with the derivatives of its state by the state at its start.

    The state is dimensionless, that of the `DriveSystem`. heyoka integrates the variational
    equations along with the motion. At a guard the derivatives jump by the saltation matrix (Leine
    and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7).
    Breakpoints are recorded. `advance` raises TooStiffError when the integration becomes too
    costly, summed over all starts.
    """

    _first_detail = Detail.DERIVATIVES

    def __init__(self, drive: Drive, gains: ContinuousControl | None = None) -> None:
        """Start at rest at X = 0, with continuous control if `gains` (SI) are given.

        The actuator has no part in it.
        """
        self.transition: FloatArray = np.empty((0, 0))
        """Derivatives of the state (rows) by the state at the start (columns)."""
        self.landed = False
        """Whether the slide has stuck since the start."""
        self._at_guard: FloatArray = np.empty(0)
        self._effort = self._begun = 0.0
        self._steps_before = 0
        super().__init__(replace(drive, actuator=IDEAL_ACTUATOR), 0.0, 0.0, gains)
        self.start(np.zeros(self.order))

    @property
    def order(self) -> int:
        """Number of components of the state."""
        return len(self._system.states)

    @property
    def state(self) -> FloatArray:
        """X, Y, the memory of the law and, with continuous control, its states."""
        return np.array(self._instant.state)

    @property
    def rate(self) -> FloatArray:
        """Derivative of the state by dimensionless time."""
        return self._rates(self._mode)[0]

    def state_at(
        self,
        position: float,
        filter_states: float | Sequence[float],
        memory: Sequence[float] | None = None,
    ) -> FloatArray:
        """Return the state at rest at a position (m), with these states of the control.

        They are given times N/k, so that W of eq. 17 is in m; one number applies to all. The memory
        of the friction law (SI) is that of steady slip by default.
        """
        scale, drive = self._drive.length_scale, self._drive
        state = np.array(self._system.initial_state(position / scale, 0.0))
        if memory is None:
            memory = drive.friction.memory_at(-drive.belt_speed, -copysign(1.0, drive.belt_speed))
        own = slice(MEMORY, MEMORY + len(self._memory_units))
        state[own] = np.array(memory) / self._memory_units
        state[self._system.control_states] = np.asarray(filter_states) / scale
        return state

    def memory_of(self, state: FloatArray) -> tuple[float, ...]:
        """Return the memory of the friction law in a state, SI units."""
        own = state[MEMORY : MEMORY + len(self._memory_units)] * self._memory_units
        return tuple(own.tolist())

    def filter_states_of(self, state: FloatArray) -> FloatArray:
        """Return the states of the control in a state; none without control."""
        return state[self._system.control_states]

    @property
    def mode(self) -> Mode:
        """The mode of the system at present."""
        return self._mode

    def start(self, state: FloatArray, mode: Mode | None = None) -> None:
        """Start again at `state`, at time zero and without breakpoints.

        The state gives the mode, except where a law has parts that stick or slip by their past.
        """
        self._recorded.clear()
        self._time = self._breakpoint_time = 0.0
        self._set_state(state.tolist())
        if mode is not None and mode.flow == self._mode.flow:
            self._enter(mode)
        self._append_present()
        self.transition = np.eye(self.order)
        self.landed = False

    def advance(self, duration: float) -> None:
        """Integrate over a duration, s; raises TooStiffError."""
        try:
            super().advance(duration)
        except RunError:
            raise TooStiffError from None

    def _begin(self, now: float, end: float) -> float:
        # Start from the identity: heyoka's error is relative to the largest of the variables.
        self._derivatives[:] = np.eye(self.order)
        self._begun, self._steps_before = now, self._steps_left
        return min(end, now + _LONGEST_SLIP) if self._mode.flow == SLIP else end

    def _reach_guard(self) -> None:
        self._at_guard = self.state

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        super()._pass(mode, guard, following, now)
        # A slide that begins to creep is put at the speed of creep, maybe beyond that of the belt.
        at_guard = self.state if guard is None else self._at_guard
        before, gradients = self._rates(mode, at_guard)
        self.transition = self._enslaving(mode) @ self._derivatives @ self.transition
        if not self._system.sticks:
            self._effort += _EFFORT_OF_A_STEP * (self._steps_before - self._steps_left)
        elif mode.flow == SLIP:
            self._effort += (now - self._begun) * (1.0 + abs(float(gradients[SPEED, SPEED])))
        if self._effort > _GREATEST_EFFORT:
            raise TooStiffError
        if guard is None or following is None:
            return
        normal = gradients[self.order + guard]
        reset = self._enslaving(following)
        jump = self._rates(following)[0] - reset @ before
        change = np.outer(jump / (normal @ before), normal @ self.transition)
        self.transition = reset @ self.transition + change
        self.landed |= following.flow != SLIP

    @property
    def _derivatives(self) -> FloatArray:
        """Derivatives of the state by that at the start of the phase, in the integrator."""
        assert self._flow is not None
        return self._flow.state[self.order :].reshape(self.order, self.order)

    def _rates(self, mode: Mode, state: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Return the rates in a mode, and the gradients, see `FlowRates`.

        They are those at a `state`, by default the present one.
        """
        state = self.state if state is None else state
        parameters = parameter_values(self._system, mode, self._instant.inputs)
        rates, gradients = flow_rates(self._system, mode.flow).at(state, parameters)
        return self._enslaving(mode, gradients) @ rates, gradients

    def _enslaving(self, mode: Mode, gradients: FloatArray | None = None) -> FloatArray:
        """Return the derivatives of the state by itself where a mode sets its slaved states."""
        found = np.eye(self.order)
        flow = flow_rates(self._system, mode.flow)
        if flow.slaved:
            if gradients is None:
                _, gradients = self._rates(mode)
            found[list(flow.slaved)] = gradients[-len(flow.slaved) :]
        return found
