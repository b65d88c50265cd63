"""A motion that records its breakpoints."""

from collections.abc import Sequence

import numpy as np

from stickslip_ros.physics.measures.breakpoints import STICK_SHARE, Breakpoints
from stickslip_ros.physics.model.control import ContinuousControl
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import POSITION, SPEED, STICK
from stickslip_ros.physics.model.hybrid import HybridSystem, Mode
from stickslip_ros.physics.motion.compiled_flow import Detail
from stickslip_ros.physics.motion.motion import Motion

_ROUNDING = 1e-9
"""Share of the speed at which a slide becomes slow that is rounding."""


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

    Examples
    --------
    The turning points of a slide that starts at rest:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> from stickslip_ros.physics.motion import RecordedMotion
    >>> drive = Drive(mass=100.0, damping=200.0, stiffness=1e6, normal_force=1000.0,
    ...               belt_speed=0.04, friction=Stribeck(0.4, 0.25, 0.05))
    >>> motion = RecordedMotion(drive, position=0.0, velocity=0.0)
    >>> motion.advance(0.1)
    >>> breakpoints = motion.take_breakpoints()
    >>> [round(1e6 * x) for x in breakpoints.position[breakpoints.velocity == 0.0][-3:]]
    [671, -71, 760]
    """

    _first_detail = Detail.MARKS

    def __init__(
        self,
        drive: Drive,
        position: float,
        velocity: float,
        control: ContinuousControl | None = None,
        stick_speed: float | None = None,
    ) -> None:
        self._recording = Detail.MARKS in self._first_detail
        self._recorded: list[tuple[float, float, float, bool]] = []
        self._breakpoint_time = 0.0
        self._stick_speed, self._peak, self._was_slow = stick_speed, 0.0, False
        super().__init__(drive, position, velocity, control)
        self._append_present()

    def restart(
        self, position: float, velocity: float, memory: Sequence[float] | None = None
    ) -> None:
        """Set the state of the slide; see `Motion.restart`."""
        super().restart(position, velocity, memory)
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
        self._set_detail(self._first_detail if recording else Detail.STATES)
        self._append_present()

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
        state, sticks = self._instant.state, self._system.sticks
        found = [] if self._flow is None else self._flow.take_marks()
        found.append((now, state[POSITION], state[SPEED]))
        for instant, x, y in found:
            sticking = mode.flow == STICK if sticks else self._stays_slow(mode, instant, y)
            self._append(instant, x, y, sticking=sticking)

    def _stays_slow(self, mode: Mode, now: float, y: float) -> bool:
        """Return whether the slide has been slow since the last breakpoint.

        The marks of the flow are where it becomes slow, or fast, and its peaks.
        """
        time = (self._time - self._origin) * self._drive.angular_frequency + now
        speed = abs(y - self._system.belt_speed(mode, time))
        self._peak = max(self._peak, speed)
        before, self._was_slow = self._was_slow, speed <= self._slow * (1.0 + _ROUNDING)
        return before and self._was_slow

    def _append_present(self) -> None:
        if self._recording:
            state = self._instant.state
            self._append(0.0, state[POSITION], state[SPEED], sticking=False)

    def _append(self, now: float, x: float, y: float, *, sticking: bool) -> None:
        time = self._time + now / self._drive.angular_frequency
        # Rounding must not take the time back.
        self._breakpoint_time = max(self._breakpoint_time, time)
        self._recorded.append((self._breakpoint_time, x, y, sticking))
