"""Records the breakpoints of a motion: where its phases and the pieces between its extremes end."""

import numpy as np

from stickslip_ros.measures.breakpoints import STICK_SHARE, Breakpoints
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import POSITION, SPEED
from stickslip_ros.model.drive_system import STICK, DriveSystem
from stickslip_ros.model.hybrid import Instant, Mode
from stickslip_ros.motion.compiled_flow import CompiledFlow
from stickslip_ros.motion.hybrid_motion import HybridMotion
from stickslip_ros.motion.motion_clock import MotionClock
from stickslip_ros.motion.phase import Phase

_SLOW_ROUNDING = 1e-9
"""Share of the speed at which a slide becomes slow that is rounding."""


class BreakpointRecorder:
    """Keeps the breakpoints of the phases of a drive, until they are taken."""

    def __init__(self, clock: MotionClock, stick_speed: float | None) -> None:
        """Follow the clock of a motion; see `RecordedMotion` for the stick speed, m/s."""
        self._clock, self._stick_speed = clock, stick_speed
        self._recorded: list[tuple[float, float, float, bool]] = []
        self._divisions: list[int] = []
        self._time = 0.0
        """Time of the last breakpoint, s."""
        self._divides = False
        """Whether the last breakpoint is not the end of a phase."""
        # For a slide with a law that has a memory: the dimensionless speed up to which it is slow,
        # the fastest one so far, and whether it was slow at the last breakpoint.
        self._slow = self._fastest = 0.0
        self._was_slow = False

    def start(self, system: DriveSystem, mode: Mode, instant: Instant) -> None:
        """Record a state that starts a motion; see `PhaseObserver`."""
        self._time = max(self._time, self._clock.time)
        self._recorded.append((self._time, instant.state[POSITION], instant.state[SPEED], False))

    def begin(self, mode: Mode, flow: CompiledFlow | None, now: float, end: float) -> float:
        """Let a phase last; see `PhaseObserver`."""
        return end

    def take(self, phase: Phase, system: DriveSystem, instant: Instant) -> None:
        """Record the breakpoints of a phase; see `PhaseObserver`."""
        self._divides = phase.guard is None and phase.following is phase.mode
        start, frequency, latest = self._clock.time, self._clock.frequency, self._time
        sticking, settles, origin = phase.mode.flow == STICK, system.sticks, phase.origin
        for since, x, y in phase.points:
            now = phase.end if since is None else origin + since
            if not settles:
                sticking = self._stays_slow(system, phase.mode, now, y)
            time = start + now / frequency
            latest = time if time > latest else latest  # rounding must not take the time back
            self._recorded.append((latest, x, y, sticking))
        self._time = latest

    def set_stick_speed(self, core: HybridMotion, drive: Drive) -> None:
        """Set the speed up to which a slide with a law that has a memory sticks to the guide."""
        automatic = STICK_SHARE * (drive.fastest_belt / drive.speed_scale or self._fastest)
        given = self._stick_speed
        self._slow = automatic if given is None else given / drive.speed_scale
        core.set_constant("stick_speed", self._slow)

    def _stays_slow(self, system: DriveSystem, mode: Mode, now: float, y: float) -> bool:
        """Return whether the slide has been slow since the last breakpoint.

        The marks of the flow are where it becomes slow, or fast, and its peaks.
        """
        speed = abs(y - system.belt_speed(mode, self._clock.scaled + now))
        self._fastest = max(self._fastest, speed)
        before, self._was_slow = self._was_slow, speed <= self._slow * (1.0 + _SLOW_ROUNDING)
        return before and self._was_slow

    def divide(self) -> None:
        """Note that the end of the last advance only divides a longer one; see `measure_block`."""
        if self._divides:
            self._divisions.append(len(self._recorded) - 1)

    def take_divisions(self) -> list[int]:
        """Return the rows of the breakpoints, not yet taken, that only divide an advance."""
        divisions, self._divisions = self._divisions, []
        return divisions

    def take_breakpoints(self, drive: Drive) -> Breakpoints:
        """Return the breakpoints since the last call, in the units of a drive, and clear them."""
        if not self._recorded:
            return Breakpoints.empty()
        time, x, y, sticking = zip(*self._recorded, strict=True)
        self._recorded.clear()
        return Breakpoints(
            np.array(time),
            np.array(x) * drive.length_scale,
            np.array(y) * drive.speed_scale,
            np.array(sticking),
        )

    def clear(self) -> None:
        """Forget the breakpoints, and start at time zero."""
        self._recorded.clear()
        self._time = 0.0
