"""A motion of a drive as it is seen: state, forces and parts in SI units."""

from collections.abc import Sequence

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import MEMORY, POSITION, SPEED
from stickslip_ros.model.drive_system import STICK, DriveSystem
from stickslip_ros.motion.hybrid_motion import HybridMotion
from stickslip_ros.samples import MotorSample


class DriveView:
    """SI view of the motion of a `DriveSystem`."""

    def __init__(self, core: HybridMotion, drive: Drive, control: ContinuousControl | None) -> None:
        """View the motion of a drive, with continuous control or without."""
        self.core = core
        """The motion, dimensionless."""
        self._view(core.system, drive, control)

    def _view(self, system: DriveSystem, drive: Drive, control: ContinuousControl | None) -> None:
        """View a system in the units of its drive and controller."""
        self._system, self._drive, self._control = system, drive, control
        # Those of the drive take longer to look up.
        self._length, self._speed = drive.length_scale, drive.speed_scale
        self._weight = drive.force_scale

    @property
    def unbounded(self) -> bool:
        """Whether the motion is unbounded; then it does not advance any further."""
        return self.core.unbounded

    @property
    def position(self) -> float:
        """Displacement of the slide, m."""
        return self.core.instant.state[POSITION] * self._length

    @property
    def velocity(self) -> float:
        """Velocity of the slide, m/s; during stick exactly the belt speed."""
        if self.core.mode.flow == STICK:
            return self.belt_speed
        return self.core.instant.state[SPEED] * self._speed

    @property
    def belt_speed(self) -> float:
        """Present speed of the belt, m/s."""
        core = self.core
        if not core.clocked:
            return self._drive.belt_speed
        return core.system.belt_speed(core.mode, core.instant.time) * self._speed

    @property
    def state(self) -> FloatArray:
        """State of the `DriveSystem`, dimensionless."""
        return np.array(self.core.instant.state)

    @property
    def sticking(self) -> bool:
        """Whether the slide stuck to the belt at the end of the last advance."""
        return self.core.mode.flow == STICK

    @property
    def friction_force(self) -> float:
        """Friction force on the slide, N, with the force held so far."""
        core = self.core
        return core.system.friction_force(core.mode, core.instant) * self._weight

    @property
    def disturbance(self) -> float:
        """Held disturbance force, N; 0 where it is a part of `force`, without actuator or motor."""
        return sum(self.core.instant.inputs[1:]) * self._weight

    @property
    def applied_force(self) -> float:
        """Present force on slide or motor, N: the held one, or that of continuous control."""
        return self.core.system.forces.control_force(self.core.instant) * self._weight

    @property
    def motor(self) -> MotorSample | None:
        """State of the motor; None if it is ideal."""
        return self.motor_of(self.core.instant.state)

    @property
    def memory(self) -> tuple[float, ...]:
        """Memory of the friction law, SI units, in the order of its `states`."""
        return self.memory_of(self.core.instant.state)

    def reading(self) -> tuple[float, float, float, float, MotorSample | None]:
        """Return position, velocity, friction force, belt speed (SI units) and motor at once."""
        core, drive = self.core, self._drive
        mode, instant = core.mode, core.instant
        state = instant.state
        speed = velocity = self.belt_speed if core.clocked else drive.belt_speed
        if mode.flow != STICK:
            velocity = state[SPEED] * self._speed
        friction = core.system.friction_force(mode, instant) * self._weight
        motor = None if drive.motor is None else self.motor_of(state)
        return state[POSITION] * self._length, velocity, friction, speed, motor

    def motor_of(self, state: "FloatArray | memoryview[float]") -> MotorSample | None:
        """Return the motor's part of a dimensionless state, SI units; None if it is ideal."""
        if self._drive.motor is None:
            return None
        position, speed = state[self._system.slots.motor].tolist()
        return MotorSample(position * self._length, speed * self._speed)

    def memory_of(self, state: "FloatArray | memoryview[float]") -> tuple[float, ...]:
        """Return the memory of the friction law in a dimensionless state, SI units."""
        units = self._memory_units
        memory = state[MEMORY : MEMORY + len(units)].tolist()
        return tuple(value * unit for value, unit in zip(memory, units, strict=True))

    def scaled_state(
        self, x: float, y: float, memory: Sequence[float] | None, motor: Sequence[float] | None
    ) -> list[float]:
        """Return the dimensionless state at X and Y, with memory and motor in SI units.

        What is not given is that of `DimensionlessDrive.initial_state`.
        """
        state = self._system.initial_state(x, y)
        if memory is not None:
            for number, (value, unit) in enumerate(zip(memory, self._memory_units, strict=True)):
                state[MEMORY + number] = value / unit
        if motor is not None and self._drive.motor is not None:
            state[self._system.slots.motor] = motor[0] / self._length, motor[1] / self._speed
        return state

    def put_control_state(
        self, state: "list[float] | memoryview[float]", control_state: Sequence[float]
    ) -> None:
        """Set the controller's part of a dimensionless state, as of the sampled law, SI units."""
        values = zip(control_state, self._control_units, strict=True)
        for index, (value, unit) in enumerate(values, self._system.slots.control.start):
            state[index] = value / unit

    @property
    def _memory_units(self) -> Sequence[float]:
        """SI value of one, for each state of the memory."""
        drive = self._drive
        return [1.0 / drive.scales.factor(unit) for unit in drive.friction.states.values()]

    @property
    def _control_units(self) -> Sequence[float]:
        """SI value of one, for each state of the continuous controller."""
        return () if self._control is None else self._control.state_scales(self._drive)
