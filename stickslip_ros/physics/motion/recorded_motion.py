"""A motion that records its breakpoints."""

import numpy as np

from stickslip_ros.deprecated_names import Renamed
from stickslip_ros.physics.measures.breakpoints import Breakpoints
from stickslip_ros.physics.model.control import ContinuousControl
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import POSITION, SPEED, STICK
from stickslip_ros.physics.model.hybrid import Mode
from stickslip_ros.physics.motion.compiled_flow import Detail
from stickslip_ros.physics.motion.motion import Motion


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
    ) -> None:
        self._recorded: list[tuple[float, float, float, bool]] = []
        self._breakpoint_time = 0.0
        super().__init__(drive, position, velocity, control)
        self._append_present()

    def restart(self, position: float, velocity: float) -> None:
        """Set the state of the slide; see `Motion.restart`.

        Parameters
        ----------
        position : float
            Displacement of the slide, m.
        velocity : float
            Velocity of the slide, m/s.
        """
        super().restart(position, velocity)
        self._append_present()

    @property
    def recording(self) -> bool:
        """Whether breakpoints are recorded now: this costs more than the motion itself."""
        return self._detail is not Detail.STATES

    @recording.setter
    def recording(self, recording: bool) -> None:
        if recording == self.recording:
            return
        self._set_detail(self._first_detail if recording else Detail.STATES)
        self._append_present()

    take_knots = Renamed("take_breakpoints")

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

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        sticking, state = mode.flow == STICK, self._instant.state
        if self._flow is not None:
            for instant, x, y in self._flow.take_marks():
                self._append(instant, x, y, sticking=sticking)
        self._append(now, state[POSITION], state[SPEED], sticking=sticking)

    def _append_present(self) -> None:
        if self.recording:
            state = self._instant.state
            self._append(0.0, state[POSITION], state[SPEED], sticking=False)

    def _append(self, now: float, x: float, y: float, *, sticking: bool) -> None:
        time = self._time + now / self._drive.angular_frequency
        # Rounding must not take the time back.
        self._breakpoint_time = max(self._breakpoint_time, time)
        self._recorded.append((self._breakpoint_time, x, y, sticking))
