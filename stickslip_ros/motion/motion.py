"""The stick-slip motion of a drive under a held force or continuous control, recorded or not."""

from array import array
from collections.abc import Sequence

from stickslip_ros.errors import RunError
from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import SPEED
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.motion.breakpoint_recorder import BreakpointRecorder
from stickslip_ros.motion.compiled_flow import Detail
from stickslip_ros.motion.drive_view import DriveView
from stickslip_ros.motion.hybrid_motion import STEPS_PER_UNIT, HybridMotion, TooManyStepsError
from stickslip_ros.motion.motion_clock import MotionClock

_STEPS_PER_SECOND = 1e8
"""Integration steps that a motion may take for each second, in the long run: minutes of work."""

_LARGEST_FORCE = 1e100
"""Largest dimensionless force; a larger one is clipped to it: both make the motion unbounded."""

_AT_REST, _FADED = 1e-300, 1e-280
"""Dimensionless speed below which a slide that fades rests, and states below which are zero then.

What fades would end among the numbers that a processor computes slowly, and never be zero.
"""


class Motion(DriveView):
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
    detail : Detail, optional
        What is integrated and found along with the states, for an observer.

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

    def __init__(
        self,
        drive: Drive,
        position: float,
        velocity: float,
        control: ContinuousControl | None = None,
        detail: Detail = Detail.STATES,
    ) -> None:
        self.clock = MotionClock()
        """Time of the motion, and of the signals."""
        system = drive_system(drive, control)
        state = system.initial_state(position / drive.length_scale, velocity / drive.speed_scale)
        super().__init__(HybridMotion(system, state, detail), drive, control)
        self._set_scales()

    def _set_scales(self) -> None:
        self._frequency = self.clock.frequency = self._drive.angular_frequency
        self.core.budget.per_unit = _STEPS_PER_SECOND / self._frequency
        self._fades = not self._system.sticks

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
        x, y = position / self._length, velocity / self._speed
        self.core.start(self.scaled_state(x, y, memory, motor), self.clock.scaled)
        self.core.note_start()

    def restart_signals(self) -> None:
        """Start the signals of belt and load again, at their time zero; the slide moves on."""
        if self.clock.signal_time == 0.0:
            return
        self.clock.restart_signals()
        if self.core.clocked:
            self.core.start(list(self.core.instant.state), self.clock.scaled)

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
    def control_state(self) -> tuple[float, ...]:
        """State of the continuous controller, SI units, as that of the sampled law."""
        scaled = self.core.instant.state[self._system.slots.control].tolist()
        return tuple(x * unit for x, unit in zip(scaled, self._control_units, strict=True))

    @control_state.setter
    def control_state(self, control_state: Sequence[float]) -> None:
        self.put_control_state(self.core.instant.state, control_state)

    @property
    def force(self) -> float:
        """Held force on slide or motor, N; an actuator with states receives it as its command."""
        return self.core.instant.inputs[0] * self._weight

    @force.setter
    def force(self, force: float) -> None:
        self.core.hold(0, self._scaled(force))

    def set_forces(self, control: float, disturbance: float) -> None:
        """Set the control force and the disturbance force, held until you set them again.

        Parameters
        ----------
        control : float
            Control force, N. An actuator with states receives it as its command.
        disturbance : float
            Disturbance force on the slide, N.
        """
        for number, force in enumerate(self._system.held_inputs(control, disturbance)):
            self.core.hold(number, self._scaled(force))

    def _scaled(self, force: float) -> float:
        """Return a force (N), dimensionless and within bounds."""
        return max(-_LARGEST_FORCE, min(_LARGEST_FORCE, force / self._weight))

    def advance_under(self, control: float, disturbance: float, duration: float) -> None:
        """Set the forces, and advance: the same as `set_forces` and `advance`, in less time.

        Parameters
        ----------
        control, disturbance : float
            Forces on the slide, N.
        duration : float
            Time to advance by, s.
        """
        core, inputs = self.core, self.core.instant.inputs
        one = len(inputs) == 1
        force = (control + disturbance if one else control) / self._weight
        if (
            not self._fades  # an advance prepares nothing else
            and (one or disturbance == inputs[1] * self._weight)
            and -_LARGEST_FORCE <= force <= _LARGEST_FORCE
            and core.step_shortly(duration * self._frequency, force)
        ):
            self._pass_time(duration)
        else:
            self.set_forces(control, disturbance)
            self.advance(duration)

    def skip(self, state: Sequence[float], force: float, advances: int, duration: float) -> None:
        """Continue after short advances in this mode that were computed elsewhere.

        Parameters
        ----------
        state : sequence of float
            Dimensionless state after them.
        force : float
            Force during the last one, N.
        advances : int
            Their number.
        duration : float
            Duration of each, s.
        """
        self.core.instant.state[:] = array("d", state)
        self.force = force
        for _ in range(advances):  # with the rounding of single ones
            self._pass_time(duration)

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
        if self.core.unbounded:
            return
        try:
            self.core.advance(duration * self._frequency)
        except TooManyStepsError:
            steps, time = STEPS_PER_UNIT, 1.0 / self._frequency
            if self.core.budget.per_unit < steps:
                steps, time = _STEPS_PER_SECOND, 1.0
            raise RunError(
                "the motion is too stiff to be followed: it takes more than "
                f"{steps:.0f} steps of integration for {time:g} s"
            ) from None
        self._pass_time(duration)

    def _pass_time(self, duration: float) -> None:
        """Add a duration to the time; enter what a corner at its end leads to."""
        core, clock = self.core, self.clock
        if self._fades and 0.0 < abs(core.instant.state[SPEED]) < _AT_REST:
            faded = (value if abs(value) > _FADED else 0.0 for value in core.instant.state)
            core.instant.state[:] = array("d", faded)
        if core.clocked:
            core.set_time(clock.pass_exactly(duration))
        else:
            clock.time += duration

    def _change(self, drive: Drive, control: ContinuousControl | None) -> None:
        """Continue with another drive and controller, in the same state of all parts."""
        old, core = self._drive, self.core
        if (drive, control) == (old, self._control):
            return
        force, disturbance, control_state = self.force, self.disturbance, self.control_state
        position, velocity, motor, memory = self.position, self.velocity, self.motor, self.memory
        x, y, *_ = core.instant.state
        lagging = core.instant.state[core.system.slots.actuator].tolist()
        before, law, old_law = core.mode, drive.friction, old.friction
        remembers = bool(law.states) and (law.name, law.states) == (old_law.name, old_law.states)
        system = drive_system(drive, control)
        self._view(system, drive, control)
        self._set_scales()
        if drive.speed_scale != old.speed_scale or drive.length_scale != old.length_scale:
            x, y = position / drive.length_scale, velocity / drive.speed_scale
        state = self.scaled_state(x, y, memory if remembers else None, motor)
        self.put_control_state(state, control_state)
        if drive.actuator.states == old.actuator.states:
            ratio = old.force_scale / drive.force_scale
            state[system.slots.actuator] = [value * ratio for value in lagging]
        inputs = [self._scaled(acting) for acting in system.held_inputs(force, disturbance)]
        core.change(system, state, inputs, self.clock.scaled)
        if remembers and law.switches:
            core.enter(system.continued(before, core.mode, core.instant))


class RecordedMotion(Motion):
    """Motion that records its breakpoints, exactly.

    Parameters
    ----------
    drive, position, velocity, control
        As for `Motion`.
    stick_speed : float, optional
        Relative speed, m/s, up to which the slide sticks, for friction with a memory, where it
        never has exactly the speed of the belt. By default it is a hundredth of the fastest belt
        speed, or, on a belt at rest, of the fastest relative speed so far.
    recording : bool, optional
        Whether breakpoints are recorded from the start; see the attribute.
    detail : Detail, optional
        What is integrated and found while breakpoints are recorded.
    """

    def __init__(
        self,
        drive: Drive,
        position: float,
        velocity: float,
        control: ContinuousControl | None = None,
        stick_speed: float | None = None,
        *,
        recording: bool = True,
        detail: Detail = Detail.MARKS,
    ) -> None:
        super().__init__(drive, position, velocity, control, detail if recording else Detail.STATES)
        self._detail = detail
        self.recorder = BreakpointRecorder(self.clock, stick_speed)
        """Keeps the breakpoints."""
        if recording:
            self.core.observer = self.recorder
            self.core.note_start()

    @property
    def recording(self) -> bool:
        """Whether breakpoints are recorded now: this costs more than the motion itself."""
        return self.core.observer is not None

    @recording.setter
    def recording(self, recording: bool) -> None:
        if recording != self.recording:
            watching = (self.recorder, self._detail) if recording else (None, Detail.STATES)
            self.core.watch(*watching)

    def divide(self) -> None:
        """Note that the end of the last advance only divides a longer one; see `measure_block`."""
        if self.recording:
            self.recorder.divide()

    def take_breakpoints(self) -> Breakpoints:
        """Return the breakpoints recorded since the last call, SI units, and clear them.

        They are in order of time; time 0 is the start of the motion.
        """
        return self.recorder.take_breakpoints(self._drive)

    def advance(self, duration: float) -> None:
        """Integrate over a duration; see `Motion.advance`."""
        if self._fades and self.recording:
            self.recorder.set_stick_speed(self.core, self._drive)
        super().advance(duration)
