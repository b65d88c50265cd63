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
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import SPEED
from stickslip_ros.model.drive_system import SLIP, STICK, DriveSystem
from stickslip_ros.model.hybrid import Instant, Mode
from stickslip_ros.motion.breakpoint_recorder import BreakpointRecorder
from stickslip_ros.motion.compiled_flow import CompiledFlow, Detail, flow_rates, parameter_values
from stickslip_ros.motion.hybrid_motion import StepBudget
from stickslip_ros.motion.motion import Motion, RecordedMotion
from stickslip_ros.motion.phase import Phase
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


class Derivatives:
    """Derivatives of the state of a motion by that at its start, and by the free constants.

    heyoka integrates the variational equations along with the motion. At a guard the derivatives
    jump by the saltation matrix (Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth
    Mechanical Systems, 2004, ch. 7), which has here a part for guards that depend on the constants.
    """

    def __init__(self) -> None:
        self._matrix: FloatArray = np.empty((0, 0))
        self._holder: CompiledFlow | None = None

    def start(self, system: DriveSystem, mode: Mode, instant: Instant) -> None:
        """Have derivatives by the state at present; see `PhaseObserver`."""
        order, count = len(system.states), len(system.free_constants)
        self._matrix, self._holder = np.eye(order, order + count), None
        # A body that sticks has the speed of the belt.
        if mode.flow == STICK:
            self._matrix[SPEED] = 0.0
        if 0.0 in mode.switches[system.switch_slots.motor]:
            self._matrix[system.slots.motor.stop - 1] = 0.0

    @property
    def matrix(self) -> FloatArray:
        """Derivatives of the states (rows); may be a view that the next step overwrites."""
        return self._matrix

    def _integrated(self, flow: CompiledFlow | None) -> FloatArray:
        """Return the derivatives in an integrator."""
        assert flow is not None
        order = len(self._matrix)
        return flow.state[order:].reshape(order, -1)

    def begin(self, mode: Mode, flow: CompiledFlow | None, now: float, end: float) -> float:
        """Hand the derivatives to the integrator; see `PhaseObserver`."""
        if flow is not self._holder:
            held = self._integrated(flow)
            held[:] = self._matrix
            self._matrix, self._holder = held, flow
        return end

    def take(self, phase: Phase, system: DriveSystem, instant: Instant) -> None:
        """Let the derivatives jump at a guard; see `PhaseObserver`."""
        if phase.guard is None or phase.following is None:
            return
        matrix, order = self._matrix.copy(), len(self._matrix)
        state = np.array(phase.state_at_guard)
        before, gradients = rates(system, phase.mode, instant, state)
        gradient = gradients[order + phase.guard]
        normal = gradient[:order] @ matrix
        normal[order:] += gradient[order:-1]
        rate = float(gradient[:order] @ before + gradient[-1])
        if abs(rate) > _GRAZING_RATE:
            after, _ = rates(system, phase.following, instant)
            change: Any = np.outer((after - before) / rate, normal)
            matrix += change
        self._matrix, self._holder = matrix, None


def rates(
    system: DriveSystem, mode: Mode, instant: Instant, state: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the rates in a mode, and the gradients, see `flow_rates`.

    They are those at a `state`, by default that of the instant.
    """
    state = np.array(instant.state) if state is None else state
    parameters = parameter_values(system, mode, instant.inputs, instant.time)
    return flow_rates(system, mode.flow, state, parameters)


class VariationalMotion(Motion):
    """Motion with the derivatives of its state by the state at the start and by constants.

    The constants are those of a `ScaledDrive`; another drive has none. All derivatives are
    dimensionless. What a law computes from its constants apart from its equations, as the elastic
    limit of `ElastoPlastic`, is held. Breakpoints are not recorded. After `restart` the derivatives
    are by the state then.
    """

    def __init__(self, drive: Drive, position: float, velocity: float) -> None:
        super().__init__(drive, position, velocity, detail=Detail.DERIVATIVES | Detail.ROUGH)
        self._derivatives = self.core.observer = Derivatives()
        self.core.note_start()

    @property
    def derivatives(self) -> FloatArray:
        """Derivatives of the states (rows) by those at the start, then by the free constants.

        They may be a view that the next step overwrites.
        """
        return self._derivatives.matrix


class Shot(Derivatives):
    """Derivatives and breakpoints since a start, with the effort of all starts."""

    def __init__(self, recorder: BreakpointRecorder, budget: StepBudget) -> None:
        """Pass the phases on to a recorder."""
        super().__init__()
        self.landed = False
        """Whether the slide has stuck since the start."""
        self._recorder, self._budget = recorder, budget
        self._effort = self._begun = 0.0
        self._steps_before = 0
        self._flow: CompiledFlow | None = None

    def start(self, system: DriveSystem, mode: Mode, instant: Instant) -> None:
        """Start again."""
        self._recorder.start(system, mode, instant)
        super().start(system, mode, instant)
        self.landed = False

    def begin(self, mode: Mode, flow: CompiledFlow | None, now: float, end: float) -> float:
        """Start from the identity: heyoka's error is relative to the largest of the variables."""
        self._flow, self._begun, self._steps_before = flow, now, self._budget.taken
        self._integrated(flow)[:] = np.eye(len(self._matrix))
        return min(end, now + _LONGEST_SLIP) if mode.flow == SLIP else end

    def take(self, phase: Phase, system: DriveSystem, instant: Instant) -> None:
        """Multiply the derivatives of the phases; raise TooStiffError beyond the effort."""
        self._matrix = self._integrated(self._flow) @ self._matrix
        self._recorder.take(phase, system, instant)
        super().take(phase, system, instant)
        guard, following = phase.guard, phase.following
        if not system.sticks:
            self._effort += _EFFORT_OF_A_STEP * (self._budget.taken - self._steps_before)
        elif phase.mode.flow == SLIP:
            # What follows may have set the speed, beyond that of the belt.
            state = None if guard is None else np.array(phase.state_at_guard)
            _, gradients = rates(system, phase.mode, instant, state)
            stiffness = 1.0 + abs(float(gradients[SPEED, SPEED]))
            self._effort += (phase.end - self._begun) * stiffness
        if self._effort > _GREATEST_EFFORT:
            raise TooStiffError
        self.landed |= guard is not None and following is not None and following.flow != SLIP


class ShootingMotion(RecordedMotion):
    """Motion with the derivatives of its state by that at its start, for searches of cycles.

    Breakpoints are recorded. `advance` raises TooStiffError when the integration becomes too
    costly, summed over all starts.
    """

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        """Start at rest at X = 0, with continuous control if `control` (SI) is given.

        The actuator has no part in it.
        """
        detail, drive = Detail.MARKS | Detail.DERIVATIVES, replace(drive, actuator=IDEAL_ACTUATOR)
        super().__init__(drive, 0.0, 0.0, control, detail=detail)
        self.shot = self.core.observer = Shot(self.recorder, self.core.budget)
        """The derivatives of the states by those at the start."""
        self.start(np.zeros(len(self.core.system.states)))

    @property
    def rate(self) -> FloatArray:
        """Derivative of the state by dimensionless time."""
        return rates(self.core.system, self.core.mode, self.core.instant)[0]

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
        drive = self._drive
        if memory is None:
            memory = drive.friction.memory_at(-drive.belt_speed, -copysign(1.0, drive.belt_speed))
        state = np.array(self.scaled_state(position / self._length, 0.0, memory, motor))
        state[self.core.system.slots.control] = np.asarray(filter_states) / self._length
        return state

    def start(self, state: FloatArray, mode: Mode | None = None) -> None:
        """Start again at `state`, at time zero and without breakpoints.

        The state gives the mode, except where a law has parts that stick or slip by their past.
        """
        core = self.core
        self.recorder.clear()
        self.clock.time = 0.0
        core.start(state.tolist(), self.clock.scaled)
        if mode is not None and mode.flow == core.mode.flow:
            core.enter(mode)
        core.note_start()

    def advance(self, duration: float) -> None:
        """Integrate over a duration, s; raises TooStiffError."""
        try:
            super().advance(duration)
        except RunError:
            raise TooStiffError from None
