"""The drive of most motions: a static law, constant belt speed and load, no actuator states."""

from stickslip_ros.model import equations
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive, ScaledDrive
from stickslip_ros.model.drive_layout import POSITION, SIGN, SPEED
from stickslip_ros.model.drive_system import SLIP, STICK, DriveSystem
from stickslip_ros.model.hybrid import Instant, Mode
from stickslip_ros.model.motor_friction import MotorFrictionSystem

_STUCK, _FORWARD, _BACKWARD = Mode(STICK, (0.0,)), Mode(SLIP, (1.0,)), Mode(SLIP, (-1.0,))
"""All modes of such a drive."""


class PlainDriveSystem(DriveSystem):
    """Drive whose law and signals have no states and no modes: a motion takes half the time.

    It sticks and slips as `DriveSystem` says: a change there is one here, too.

    Under a held force a slide that sticks moves in a straight line, which is not integrated.
    """

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        super().__init__(drive, control)
        self._speed, self._friction = self.drive.belt_speed, self.drive.friction.coefficient
        # Whether the belt bends the spring; without one a held force never releases the slide.
        self._loads = self._speed != 0.0 and self.drive.has_spring

    def friction_force(self, mode: Mode, instant: Instant) -> float:
        """Return the friction force on the slide."""
        sign = mode.switches[SIGN]
        if sign == 0.0:
            return self.forces.reaction(instant)
        return float(self._friction(instant.state[SPEED] - self._speed, sign))

    def settled(self, mode: Mode, instant: Instant) -> Mode:
        """Return stick, or slip in the direction of the relative speed."""
        relative_speed = instant.state[SPEED] - self._speed
        if relative_speed > 0.0:
            return _FORWARD
        if relative_speed < 0.0:
            return _BACKWARD
        settled = self._resting(mode, instant)
        if settled is mode is _STUCK and self.control is not None:
            self.nudge_off_guard(_STUCK, instant)
        return settled

    def _resting(self, mode: Mode, instant: Instant) -> Mode:
        held = self.forces.reaction(instant)
        if held > self.backward_limit:
            return _BACKWARD
        return _FORWARD if held < -self.forward_limit else _STUCK

    def _slip(self, mode: Mode, sign: float, instant: Instant) -> Mode:
        return _FORWARD if sign > 0.0 else _BACKWARD

    def has_closed_form(self, mode: Mode) -> bool:
        """Return whether the slide moves in a straight line: it sticks under a held force."""
        return mode.flow == STICK and self.control is None

    def closed_form(
        self, mode: Mode, instant: Instant, duration: float
    ) -> tuple[int | None, float]:
        """Move with the belt for `duration`, or until the reaction reaches its limit."""
        state, speed = instant.state, self._speed
        if self._loads:
            limit = self.backward_limit if speed > 0.0 else -self.forward_limit
            limit -= equations.reaction(self.drive, 0.0, speed, instant.inputs[0])
            time = (limit - state[POSITION]) / speed
            if time < 0.0:  # by rounding
                time = 0.0
            if time < duration:
                state[POSITION] = limit
                return (0 if speed > 0.0 else 1), time
        state[POSITION] += speed * duration
        return None, duration


def drive_system(drive: Drive, control: ContinuousControl | None = None) -> DriveSystem:
    """Return the dimensionless system of a drive and its continuous control, both in SI units."""
    if isinstance(drive, ScaledDrive):
        return DriveSystem(drive, control)
    law, moves, motor = drive.friction, drive.belt.pieces or drive.load.pieces, drive.motor
    if motor is not None and motor.sticks:
        return MotorFrictionSystem(drive, control)
    plain = not moves and not law.states and not law.switches and not drive.actuator.states
    if plain and motor is None:
        return PlainDriveSystem(drive, control)
    return DriveSystem(drive, control)
