"""The drive of most motions: a static law, constant belt speed and load, no actuator states."""

from stickslip_ros.model import equations
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive, ScaledDrive
from stickslip_ros.model.drive_layout import POSITION
from stickslip_ros.model.drive_system import STICK, DriveSystem
from stickslip_ros.model.hybrid import Instant, Mode
from stickslip_ros.model.motor_friction import MotorFrictionSystem


class PlainDriveSystem(DriveSystem):
    """Drive whose law and signals have no states and no modes, as that of most motions.

    Under a held force a slide that sticks moves in a straight line, which is not integrated.
    """

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        super().__init__(drive, control)
        self.closed_flow = STICK if control is None else None

    def closed_form(
        self, mode: Mode, instant: Instant, duration: float
    ) -> tuple[int | None, float]:
        """Move with the belt for `duration`, or until the reaction reaches its limit."""
        state, speed = instant.state, self._speed
        if speed != 0.0 and self.drive.has_spring:  # the belt bends the spring
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
