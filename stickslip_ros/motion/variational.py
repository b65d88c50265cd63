"""The motion and its derivatives by the state at its start and by constants of the drive."""

from collections.abc import Sequence
from dataclasses import replace
from math import copysign
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import RunError
from stickslip_ros.model.actuator import IDEAL_ACTUATOR
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.dimensionless_drive import MEMORY, SPEED
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_system import SLIP, STICK
from stickslip_ros.model.hybrid import Mode
from stickslip_ros.motion.compiled_flow import (
    CompiledFlow,
    Detail,
    flow_rates,
    parameter_values,
)
from stickslip_ros.motion.motion import RecordedMotion
from stickslip_ros.samples import RESTING_MOTOR, MotorSample

_GRAZING_RATE = 1e-12
"""Rate of a margin below which a motion grazes a guard: the instant has no derivative there."""

_GREATEST_EFFORT = 8e6
"""Limit of slip time times stiffness, dimensionless, for a motion: some seconds of work."""

_EFFORT_OF_A_STEP = 7.0
"""Time of a step, times the stiffness that limits it."""

_LONGEST_SLIP = 30.0
"""Dimensionless time after which the effort of a slip is added up."""


class TooStiffError(Exception):
    """Raised when a motion takes too many steps; it does not depend on the speed of the machine."""


class VariationalMotion(RecordedMotion):
    """Motion with the derivatives of its state by the state at the start and by constants.

    The constants are those of a `ScaledDrive`; another drive has none. All derivatives are
    dimensionless. heyoka integrates the variational equations along with the motion. At a guard
    the derivatives jump by the saltation matrix (Leine and Nijmeijer, Dynamics and Bifurcations of
    Non-Smooth Mechanical Systems, 2004, ch. 7), which has here a part for guards that depend on
    the constants. What a law computes from its constants apart from its equations, as the elastic
    limit of `ElastoPlastic`, is held. Breakpoints are not recorded.
    """

    _recorded_detail = Detail.DERIVATIVES

    def __init__(
        self,
        drive: Drive,
        position: float,
        velocity: float,
        control: ContinuousControl | None = None,
    ) -> None:
        self._found: FloatArray = np.empty((0, 0))
        self._holder: CompiledFlow | None = None
        self._at_guard: FloatArray = np.empty(0)
        super().__init__(drive, position, velocity, control)
        self._begin_again()

    def restart(
        self,
        position: float,
        velocity: float,
        memory: Sequence[float] | None = None,
        motor: Sequence[float] | None = None,
    ) -> None:
        """Set the state of the slide; derivatives are by this state from now on."""
        super().restart(position, velocity, memory, motor)
        self._begin_again()

    def _begin_again(self) -> None:
        order, count = self.order, len(self._system.free_constants)
        self._found, self._holder = np.eye(order, order + count), None
        # A body that sticks has the speed of the belt.
        if self._mode.flow == STICK:
            self._found[SPEED] = 0.0
        if 0.0 in self._system.by_part(self._mode.switches).motor:
            self._found[self._system.motor_states.stop - 1] = 0.0

    @property
    def order(self) -> int:
        """Number of components of the state."""
        return len(self._system.states)

    @property
    def state(self) -> FloatArray:
        """The state of the `DriveSystem`, dimensionless."""
        return np.array(self._instant.state)

    @property
    def derivatives(self) -> FloatArray:
        """Derivatives of the states (rows) by those at the start, then by the free constants.

        They may be a view that the next step overwrites.
        """
        return self._found if self._holder is None else self._integrated(self._holder)

    def _integrated(self, flow: CompiledFlow | None) -> FloatArray:
        """Return the derivatives in an integrator."""
        assert flow is not None
        order = len(self._system.states)
        return flow.state[order:].reshape(order, -1)

    def _begin(self, now: float, end: float) -> float:
        if self._flow is not self._holder:
            found = self.derivatives
            self._integrated(self._flow)[:] = found
            self._holder = self._flow
        return end

    def _reach_guard(self) -> None:
        # What follows may set a part of the state.
        self._at_guard = self.state

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        super()._pass(mode, guard, following, now)
        if guard is not None and following is not None:
            self._jump(mode, guard, following, self.derivatives.copy())

    def _jump(self, mode: Mode, guard: int, following: Mode, found: FloatArray) -> None:
        """Let derivatives jump at a guard."""
        before, gradients = self._rates(mode, self._at_guard)
        order = self.order
        own = gradients[order + guard]
        normal = own[:order] @ found
        normal[order:] += own[order:-1]
        rate = float(own[:order] @ before + own[-1])
        if abs(rate) > _GRAZING_RATE:
            after, _ = self._rates(following)
            change: Any = np.outer((after - before) / rate, normal)
            found += change
        self._found, self._holder = found, None

    def _rates(self, mode: Mode, state: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Return the rates in a mode, and the gradients, see `FlowRates`.

        They are those at a `state`, by default the present one.
        """
        state, instant = self.state if state is None else state, self._instant
        parameters = parameter_values(self._system, mode, instant.inputs, instant.time)
        return flow_rates(self._system, mode.flow).at(state, parameters)


class ShootingMotion(VariationalMotion):
    """Motion with the derivatives of its state by that at its start, for searches of cycles.

    Breakpoints are recorded. `advance` raises TooStiffError when the integration becomes too
    costly, summed over all starts.
    """

    _recorded_detail = Detail.MARKS | Detail.DERIVATIVES

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        """Start at rest at X = 0, with continuous control if `control` (SI) is given.

        The actuator has no part in it.
        """
        self.landed = False
        """Whether the slide has stuck since the start."""
        self._effort = self._begun = 0.0
        self._steps_before = 0
        super().__init__(replace(drive, actuator=IDEAL_ACTUATOR), 0.0, 0.0, control)
        self.start(np.zeros(self.order))

    @property
    def rate(self) -> FloatArray:
        """Derivative of the state by dimensionless time."""
        return self._rates(self._mode)[0]

    def state_at(
        self,
        position: float,
        filter_states: float | Sequence[float],
        memory: Sequence[float] | None = None,
        motor: MotorSample = RESTING_MOTOR,
    ) -> FloatArray:
        """Return the state at rest at a position (m), with these states of the control.

        They are given times N/k, so that W of eq. 17 is in m; one number applies to all. The memory
        of the friction law (SI) is that of steady slip by default.
        """
        scale, drive = self._drive.length_scale, self._drive
        found = self._system.initial_state(position / scale, 0.0)
        if memory is None:
            memory = drive.friction.memory_at(-drive.belt_speed, -copysign(1.0, drive.belt_speed))
        self._put_memory(found, memory)
        self._put_motor(found, motor)
        state = np.array(found)
        state[self._system.control_states] = np.asarray(filter_states) / scale
        return state

    def motor_of(self, state: FloatArray) -> MotorSample | None:
        """Return the motor's part of a state, SI units; None if it is ideal."""
        return self._motor_in(state)

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
        self._begin_again()
        self.landed = False

    def advance(self, duration: float) -> None:
        """Integrate over a duration, s; raises TooStiffError."""
        try:
            super().advance(duration)
        except RunError:
            raise TooStiffError from None

    def _begin(self, now: float, end: float) -> float:
        # Start from the identity: heyoka's error is relative to the largest of the variables.
        self._integrated(self._flow)[:] = np.eye(self.order)
        self._begun, self._steps_before = now, self._steps
        return min(end, now + _LONGEST_SLIP) if self._mode.flow == SLIP else end

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        self._found = self._integrated(self._flow) @ self._found
        super()._pass(mode, guard, following, now)
        if not self._system.sticks:
            self._effort += _EFFORT_OF_A_STEP * (self._steps - self._steps_before)
        elif mode.flow == SLIP:
            # What follows may have set the speed, beyond that of the belt.
            state = self.state if guard is None else self._at_guard
            _, gradients = self._rates(mode, state)
            self._effort += (now - self._begun) * (1.0 + abs(float(gradients[SPEED, SPEED])))
        if self._effort > _GREATEST_EFFORT:
            raise TooStiffError
        self.landed |= guard is not None and following is not None and following.flow != SLIP
