"""The stick-slip motion of a drive under a held force or continuous control, recorded or not."""

from array import array
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import RunError
from stickslip_ros.measures.breakpoints import STICK_SHARE, Breakpoints
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.dimensionless_drive import MEMORY, POSITION, SPEED
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_system import STICK, TIME_ROUNDING, DriveSystem
from stickslip_ros.model.hybrid import HybridSystem, Instant, Mode
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.motion.compiled_flow import Detail
from stickslip_ros.motion.hybrid_motion import (
    STEPS_PER_UNIT,
    HybridMotion,
    TooManyStepsError,
)
from stickslip_ros.samples import MotorSample

_STEPS_PER_SECOND = 1e8
"""Integration steps that a motion may take for each second, in the long run: minutes of work."""

_LARGEST_FORCE = 1e100
"""Largest dimensionless force; a larger one is clipped to it: both make the motion unbounded."""

_AT_REST, _FADED = 1e-300, 1e-280
"""Dimensionless speed below which a slide that fades rests, and states below which are zero then.

What fades would end among the numbers that a processor computes slowly, and never be zero.
"""

_SLOW_ROUNDING = 1e-9
"""Share of the speed at which a slide becomes slow that is rounding."""


_Point = tuple[float | None, float, float, bool]
"""Breakpoint of a phase: time since its start, None at its end; x, y, and whether it sticks."""


class Motion(HybridMotion):
    """Motion of a drive: stick, slip and the transitions between them, to machine precision.

    It integrates the `DriveSystem` of the drive. All inputs and outputs are in SI units. You may
    change drive, force and controller between calls of `advance`; the changes take effect from then
    on.

    Parameters
    ----------
    drive : Drive
        Drive in motion.
    position : float
        Displacement of the slide at the start, m.
    velocity : float
        Velocity of the slide at the start, m/s.
    control : ContinuousControl, optional
        Controller that acts without sampling, eq. 19; it starts at rest. By default the
        force is `force`.

    Examples
    --------
    The first millisecond of a slide that starts at rest:

    >>> from stickslip_ros.model.drive import Drive
    >>> from stickslip_ros.model.friction import Stribeck
    >>> from stickslip_ros.motion import Motion
    >>> drive = Drive(mass=100.0, damping=200.0, stiffness=1e6, normal_force=1000.0,
    ...               belt_speed=0.04, friction=Stribeck(0.4, 0.25, 0.05))
    >>> motion = Motion(drive, position=0.0, velocity=0.0)
    >>> motion.advance(0.001)
    >>> round(1e6 * motion.position, 3), motion.sticking
    (1.297, False)
    """

    _system: DriveSystem
    _first_detail = Detail.STATES

    def __init__(
        self,
        drive: Drive,
        position: float,
        velocity: float,
        control: ContinuousControl | None = None,
    ) -> None:
        self._drive, self._control = drive, control
        self._time = 0.0
        # What the sum of the durations has lost by rounding, and the start of the signals.
        self._lost = self._origin = 0.0
        system = drive_system(drive, control)
        state = system.initial_state(position / drive.length_scale, velocity / drive.speed_scale)
        super().__init__(system, state, self._first_detail)

    def restart(
        self,
        position: float,
        velocity: float,
        memory: Sequence[float] | None = None,
        motor: Sequence[float] | None = None,
    ) -> None:
        """Set the state of the slide; forces and gains are kept, the controller is at rest.

        An actuator with states gives no force. The signals of belt and load continue.

        Parameters
        ----------
        position : float
            Displacement of the slide, m.
        velocity : float
            Velocity of the slide, m/s.
        memory : sequence of float, optional
            Memory of the friction law, SI units, as in `memory`; by default its initial memory.
        motor : sequence of float, optional
            Displacement, m, and velocity, m/s, of the motor; by default it rests at the reference.
        """
        drive = self._drive
        x, y = position / drive.length_scale, velocity / drive.speed_scale
        state = self._system.initial_state(x, y)
        if memory is not None:
            self._put_memory(state, memory)
        if motor is not None:
            self._put_motor(state, motor)
        self._set_clock()
        self._set_state(state)

    def _use(self, system: HybridSystem) -> None:
        super()._use(system)
        drive = self._drive
        # Those of the drive take longer to look up.
        self._frequency, self._length = drive.angular_frequency, drive.length_scale
        self._speed, self._weight = drive.speed_scale, drive.force_scale
        self._steps_per_unit = _STEPS_PER_SECOND / self._frequency
        self._one_force = len(self._system.inputs) == 1
        self._fades = not self._system.sticks

    @property
    def memory(self) -> tuple[float, ...]:
        """Memory of the friction law, SI units, in the order of its `states`."""
        units = self._memory_units
        own = self._instant.state[MEMORY : MEMORY + len(units)].tolist()
        return tuple(each * unit for each, unit in zip(own, units, strict=True))

    def _put_memory(self, state: list[float], memory: Sequence[float]) -> None:
        for number, (each, unit) in enumerate(zip(memory, self._memory_units, strict=True)):
            state[MEMORY + number] = each / unit

    def _put_motor(self, state: list[float], motor: Sequence[float]) -> None:
        """Set the state of the motor (SI); one that is ideal has none."""
        drive = self._drive
        if drive.motor is not None:
            scaled = motor[0] / drive.length_scale, motor[1] / drive.speed_scale
            state[self._system.motor_states] = scaled

    @property
    def _memory_units(self) -> Sequence[float]:
        """SI value of one, for each state of the memory."""
        drive = self._drive
        return [1.0 / drive.scales.factor(unit) for unit in drive.friction.states.values()]

    def restart_signals(self) -> None:
        """Start the signals of belt and load again, at their time zero; the slide moves on."""
        if self.signal_time == 0.0:
            return
        self._origin, self._lost = self._time, 0.0
        if not self._system.autonomous:
            self._set_clock()
            self._set_state(list(self._instant.state))

    @property
    def signal_time(self) -> float:
        """Time of the signals of belt and load, s."""
        return self._time - self._origin

    def signal_times(self, times: FloatArray) -> Sequence[float]:
        """Return the times of the signals at times of the motion.

        Parameters
        ----------
        times : array of shape (instants,)
            Times of the motion, as of breakpoints, s.

        Returns
        -------
        sequence of float
            Times since the signals started, s.
        """
        return (times - self._origin).tolist()

    @property
    def drive(self) -> Drive:
        """Drive in motion; a new one keeps position, velocity, held forces and actuator states."""
        return self._drive

    @drive.setter
    def drive(self, drive: Drive) -> None:
        self._change(drive, self._control)

    @property
    def control(self) -> ContinuousControl | None:
        """Continuous controller, SI units; its state as of the sampled law is kept at a change."""
        return self._control

    @control.setter
    def control(self, control: ContinuousControl | None) -> None:
        if (control is None) != (self._control is None):
            raise TypeError("a motion has continuous control from its start, or never")
        self._change(self._drive, control)

    @property
    def force(self) -> float:
        """Held force on slide or motor, N; an actuator with states receives it as its command."""
        return self._instant.inputs[0] * self._drive.force_scale

    @force.setter
    def force(self, force: float) -> None:
        self._hold(0, force)

    def set_forces(self, control: float, disturbance: float) -> None:
        """Set the control force and the disturbance force, held until you set them again.

        Parameters
        ----------
        control : float
            Control force, N. An actuator with states receives it as its command.
        disturbance : float
            Disturbance force on the slide, N.
        """
        if len(self._instant.inputs) > 1:
            if disturbance != self._instant.inputs[1] * self._drive.force_scale:
                self._hold(1, disturbance)
        else:
            control += disturbance
        self._hold(0, control)

    def _hold(self, number: int, force: float) -> None:
        scaled = force / self._drive.force_scale
        if not -_LARGEST_FORCE <= scaled <= _LARGEST_FORCE:
            scaled = max(-_LARGEST_FORCE, min(_LARGEST_FORCE, scaled))
        self._instant.inputs[number] = scaled
        if self._flow is not None:
            for used, index in self._flow.inputs:
                if used == number:
                    self._flow.parameters[index] = scaled

    @property
    def disturbance(self) -> float:
        """Held disturbance force, N; 0 where it is a part of `force`, without actuator or motor."""
        return sum(self._instant.inputs[1:]) * self._drive.force_scale

    @property
    def applied_force(self) -> float:
        """Present force on slide or motor, N: the held one, or that of continuous control."""
        return self._system.control_force(self._instant) * self._drive.force_scale

    @property
    def control_state(self) -> tuple[float, ...]:
        """State of the continuous controller, SI units, as that of the sampled law."""
        state = self._instant.state[self._system.control_states].tolist()
        return tuple(
            each * scale for each, scale in zip(state, self._control_scales(), strict=True)
        )

    @control_state.setter
    def control_state(self, control_state: Sequence[float]) -> None:
        self._put_control_state(self._instant.state, control_state)

    def _put_control_state(
        self, state: "list[float] | memoryview[float]", control_state: Sequence[float]
    ) -> None:
        scaled = zip(control_state, self._control_scales(), strict=True)
        for index, (each, scale) in enumerate(scaled, self._system.control_states.start):
            state[index] = each / scale

    def _control_scales(self) -> Sequence[float]:
        return () if self._control is None else self._control.state_scales(self._drive)

    @property
    def position(self) -> float:
        """Displacement of the slide, m."""
        return self._instant.state[POSITION] * self._drive.length_scale

    @property
    def velocity(self) -> float:
        """Velocity of the slide, m/s; during stick exactly the belt speed."""
        if self._mode.flow == STICK:
            return self.belt_speed
        return self._instant.state[SPEED] * self._drive.speed_scale

    @property
    def motor(self) -> MotorSample | None:
        """State of the motor; None if it is ideal."""
        return None if self._drive.motor is None else self._motor_in(self._instant.state)

    def _motor_in(self, state: "FloatArray | memoryview[float]") -> MotorSample | None:
        drive = self._drive
        if drive.motor is None:
            return None
        position, speed = state[self._system.motor_states].tolist()
        return MotorSample(position * drive.length_scale, speed * drive.speed_scale)

    @property
    def belt_speed(self) -> float:
        """Present speed of the belt, m/s."""
        if not self._clocked:
            return self._drive.belt_speed
        return self._system.belt_speed(self._mode, self._instant.time) * self._drive.speed_scale

    @property
    def sticking(self) -> bool:
        """Whether the slide stuck to the belt at the end of the last advance."""
        return self._mode.flow == STICK

    @property
    def friction_force(self) -> float:
        """Friction force on the slide, N, with the force held so far."""
        scaled = self._system.friction_force(self._mode, self._instant)
        return scaled * self._drive.force_scale

    def advance_under(self, control: float, disturbance: float, duration: float) -> None:
        """Set the forces, and advance: the same as `set_forces` and `advance`, in less time.

        Parameters
        ----------
        control, disturbance : float
            Forces on the slide, N.
        duration : float
            Time to advance by, s.
        """
        step, scaled = self._short_step, duration * self._frequency
        force = (control + disturbance if self._one_force else control) / self._weight
        if (
            step is not None
            and self._system.sticks  # an advance prepares nothing else
            and (self._one_force or disturbance == self._instant.inputs[1] * self._weight)
            and -_LARGEST_FORCE <= force <= _LARGEST_FORCE
            and step(scaled, force)
        ):
            self._pass_shortly(scaled)
            self._pass_time(duration)
        else:
            self.set_forces(control, disturbance)
            self.advance(duration)

    @property
    def phase(self) -> tuple[DriveSystem, Mode, Instant]:
        """Dimensionless system, its mode, and state and inputs."""
        return self._system, self._mode, self._instant

    def skip(self, state: Sequence[float], force: float, advances: int, duration: float) -> None:
        """Continue after short advances in this mode that were computed elsewhere.

        Parameters
        ----------
        state : sequence of float
            State of `phase` after them.
        force : float
            Force during the last one, N.
        advances : int
            Their number.
        duration : float
            Duration of each, s.
        """
        self._instant.state[:] = array("d", state)
        self.force = force
        for _ in range(advances):  # with the rounding of single ones
            self._pass_time(duration)

    def reading(self) -> tuple[float, float, float, float, MotorSample | None]:
        """Return position, velocity, friction force, belt speed (SI units) and motor at once."""
        mode, instant, drive = self._mode, self._instant, self._drive
        state = instant.state
        speed = velocity = self.belt_speed if self._clocked else drive.belt_speed
        if mode.flow != STICK:
            velocity = state[SPEED] * self._speed
        friction = self._system.friction_force(mode, instant) * self._weight
        motor = None if drive.motor is None else self.motor
        return state[POSITION] * self._length, velocity, friction, speed, motor

    def advance(self, duration: float) -> None:
        """Integrate over a duration, the force held; stop early if the motion becomes unbounded.

        Parameters
        ----------
        duration : float
            Duration, s.

        Raises
        ------
        RunError
            If the motion is so stiff that it would take too many steps.
        """
        if self.unbounded:
            return
        try:
            self._advance(duration * self._frequency)
        except TooManyStepsError:
            steps, time = STEPS_PER_UNIT, 1.0 / self._frequency
            if self._steps_per_unit < steps:
                steps, time = _STEPS_PER_SECOND, 1.0
            raise RunError(
                "the motion is too stiff to be followed: it takes more than "
                f"{steps:.0f} steps of integration for {time:g} s"
            ) from None
        self._pass_time(duration)

    def _pass_time(self, duration: float) -> None:
        """Add a duration to the time; enter what a corner at its end leads to."""
        if self._fades and 0.0 < abs(self._instant.state[SPEED]) < _AT_REST:
            faded = (each if abs(each) > _FADED else 0.0 for each in self._instant.state)
            self._instant.state[:] = array("d", faded)
        if not self._clocked:
            self._time += duration
            return
        before, duration = self._time, duration - self._lost
        self._time = time = before + duration
        self._lost = (time - before) - duration
        self._instant.time = time = (time - self._origin) * self._frequency
        if time + TIME_ROUNDING * time >= self._switch_time:
            self._enter(self._system.switch_inputs(self._mode, self._instant))

    def _set_clock(self) -> None:
        """Set the time of the signals: sums of the scaled durations would drift."""
        self._instant.time = (self._time - self._origin) * self._drive.angular_frequency

    def _change(self, drive: Drive, control: ContinuousControl | None) -> None:
        """Continue with another drive and controller, in the same state of all parts."""
        if (drive, control) == (self._drive, self._control):
            return
        old, force, disturbance = self._drive, self.force, self.disturbance
        position, velocity = self.position, self.velocity
        control_state = self.control_state
        lagging = self._instant.state[self._system.actuator_states].tolist()
        x, y, *_ = self._instant.state.tolist()
        motor = self.motor
        memory, law, old_law = self.memory, drive.friction, old.friction
        self._drive, self._control = drive, control
        self._use(drive_system(drive, control))
        system = self._system
        if drive.speed_scale != old.speed_scale or drive.length_scale != old.length_scale:
            x, y = position / drive.length_scale, velocity / drive.speed_scale
        state = system.initial_state(x, y)
        remembers = bool(law.states) and (law.name, law.states) == (old_law.name, old_law.states)
        if remembers:
            self._put_memory(state, memory)
        if control is not None:
            self._put_control_state(state, control_state)
        if drive.actuator.states == old.actuator.states:
            ratio = old.force_scale / drive.force_scale
            state[system.actuator_states] = [each * ratio for each in lagging]
        if motor is not None:
            self._put_motor(state, motor)
        self._set_clock()
        self._instant.inputs = [0.0] * len(system.inputs)
        self.set_forces(force, disturbance)
        before = self._mode
        self._set_state(state)
        if remembers and law.switches:
            self._enter(system.continued(before, self._mode, self._instant))


class RecordedMotion(Motion):
    """Motion that records its breakpoints, exactly.

    Parameters
    ----------
    drive : Drive
        Drive in motion.
    position : float
        Displacement of the slide at the start, m.
    velocity : float
        Velocity of the slide at the start, m/s.
    control : ContinuousControl, optional
        Controller that acts without sampling; see `Motion`.
    stick_speed : float, optional
        Relative speed, m/s, up to which the slide sticks, for friction with a memory, where it
        never has exactly the speed of the belt. By default it is a hundredth of the fastest belt
        speed, or, on a belt at rest, of the fastest relative speed so far.
    recording : bool, optional
        Whether breakpoints are recorded from the start; see the attribute.
    """

    _recorded_detail: ClassVar[Detail] = Detail.MARKS

    def __init__(
        self,
        drive: Drive,
        position: float,
        velocity: float,
        control: ContinuousControl | None = None,
        stick_speed: float | None = None,
        *,
        recording: bool = True,
    ) -> None:
        self._first_detail = self._recorded_detail if recording else Detail.STATES
        self._recording = Detail.MARKS in self._first_detail
        self._recorded: list[tuple[float, float, float, bool]] = []
        self._divided: list[int] = []
        self._ends_in_phase = False
        """Whether the last breakpoint is not the end of a phase."""
        self._passed: list[_Point] = []
        self._breakpoint_time = 0.0
        self._stick_speed, self._peak, self._was_slow = stick_speed, 0.0, False
        super().__init__(drive, position, velocity, control)
        self._append_present()

    def restart(
        self,
        position: float,
        velocity: float,
        memory: Sequence[float] | None = None,
        motor: Sequence[float] | None = None,
    ) -> None:
        """Set the state of the slide; see `Motion.restart`."""
        super().restart(position, velocity, memory, motor)
        self._append_present()

    @property
    def recording(self) -> bool:
        """Whether breakpoints are recorded now: this costs more than the motion itself."""
        return self._recording

    @recording.setter
    def recording(self, recording: bool) -> None:
        if recording == self._recording:
            return
        self._recording = recording
        self._set_detail(self._recorded_detail if recording else Detail.STATES)
        self._append_present()

    def divide(self) -> None:
        """Note that the end of the last advance only divides a longer one; see `measure_block`."""
        if self._recording and self._ends_in_phase:
            self._divided.append(len(self._recorded) - 1)

    def take_divisions(self) -> list[int]:
        """Return the rows of the breakpoints, not yet taken, that only divide an advance."""
        divided, self._divided = self._divided, []
        return divided

    def take_breakpoints(self) -> Breakpoints:
        """Return the breakpoints recorded since the last call, and clear them.

        Returns
        -------
        Breakpoints
            Breakpoints in order of time, in SI units; time 0 is the start of the motion.
        """
        if not self._recorded:
            return Breakpoints.empty()
        time, x, y, sticking = zip(*self._recorded, strict=True)
        self._recorded.clear()
        return Breakpoints(
            np.array(time),
            np.array(x) * self._drive.length_scale,
            np.array(y) * self._drive.speed_scale,
            np.array(sticking),
        )

    def advance(self, duration: float) -> None:
        """Integrate over a duration; see `Motion.advance`."""
        if not self._system.sticks and self._recording:
            self._set_stick_speed()
        super().advance(duration)

    def _use(self, system: HybridSystem) -> None:
        super()._use(system)
        if not self._system.sticks:
            self._set_stick_speed()

    def _set_stick_speed(self) -> None:
        """Set the relative speed up to which a slide with a law that has a memory sticks."""
        fastest = self._drive.fastest_belt
        automatic = STICK_SHARE * (fastest / self._drive.speed_scale or self._peak)
        given = self._stick_speed
        self._slow = automatic if given is None else given / self._drive.speed_scale
        self._set_constant("stick_speed", self._slow)

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        if not self._recording:
            return
        self._ends_in_phase = guard is None and following is mode
        state, sticks, begun = self._instant.state, self._system.sticks, self._begun
        marks = [] if self._flow is None else self._flow.take_marks()
        self._passed = passed = list[_Point]()
        for instant, x, y in (*marks, (None, state[POSITION], state[SPEED])):
            time = now if instant is None else begun + instant
            sticking = mode.flow == STICK if sticks else self._stays_slow(mode, time, y)
            passed.append((instant, x, y, sticking))
        self._record(passed, begun, now)

    @override
    def _kept(self) -> tuple[list[_Point], bool]:
        return self._passed, self._was_slow

    @override
    def _recall(self, kept: tuple[list[_Point], bool], begun: float, now: float) -> None:
        points, self._was_slow = kept
        self._record(points, begun, now)

    def _stays_slow(self, mode: Mode, now: float, y: float) -> bool:
        """Return whether the slide has been slow since the last breakpoint.

        The marks of the flow are where it becomes slow, or fast, and its peaks.
        """
        time = (self._time - self._origin) * self._drive.angular_frequency + now
        speed = abs(y - self._system.belt_speed(mode, time))
        self._peak = max(self._peak, speed)
        before, self._was_slow = self._was_slow, speed <= self._slow * (1.0 + _SLOW_ROUNDING)
        return before and self._was_slow

    def _append_present(self) -> None:
        if self._recording:
            state = self._instant.state
            self._record([(None, state[POSITION], state[SPEED], False)], 0.0, 0.0)

    def _record(self, points: list[_Point], begun: float, now: float) -> None:
        """Record the breakpoints of a phase, from `begun` to `now`."""
        start, frequency, latest = self._time, self._frequency, self._breakpoint_time
        for instant, x, y, sticking in points:
            time = start + (now if instant is None else begun + instant) / frequency
            latest = time if time > latest else latest  # rounding must not take the time back
            self._recorded.append((latest, x, y, sticking))
        self._breakpoint_time = latest
