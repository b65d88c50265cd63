"""The equations of motion, eq. 5, and the forces in a drive at an instant.

They are written once, for floats, arrays and heyoka expressions: a drive may have expressions for
its constants. The integrator of the motion and all derivatives are compiled from them.
"""

from collections.abc import Sequence
from typing import Any

from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.control.base import seen_by
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import POSITION, SPEED, DriveStates
from stickslip_ros.model.hybrid import Instant
from stickslip_ros.model.motor import Motor


def reaction(drive: Drive, stretch: Any, stretch_rate: Any, force: Any) -> Any:
    """Return h = k x + c x' - u - bias: friction of this force leaves the slide no acceleration.

    With a motor of finite mass the stretch of the spring is x - X, and u is the disturbance.
    """
    return drive.stiffness * stretch + drive.damping * stretch_rate - force - drive.bias_force


def guide_reaction(drive: Drive, relative_speed: Any) -> Any:
    """Return c_g (x' - v_belt), what viscous friction of the guide adds to h."""
    return drive.guide_damping * relative_speed


def motor_reaction(
    drive: Drive, motor: Motor, stretch: Any, stretch_rate: Any, relative_speed: Any, force: Any
) -> Any:
    """Return -k (x - X) - c (x' - X') + c_m (X' - v_belt) - u, the reaction of the motor."""
    spring = drive.stiffness * stretch + drive.damping * stretch_rate
    return motor.damping * relative_speed - spring - force


def acceleration(drive: Drive, friction_force: Any, reaction: Any) -> Any:
    """Return x'' = (F - h)/m, eq. 5, with the friction force F = N mu(x' - v_belt)."""
    return (friction_force - reaction) / drive.mass


def normal_force(drive: Drive, time: Any, switches: Sequence[Any] = ()) -> Any:
    """Return the normal force N(t), with the load."""
    return drive.normal_force + drive.load.value(time, switches)


def belt_speed(drive: Drive, time: Any, switches: Sequence[Any] = ()) -> Any:
    """Return the speed of the belt v_belt(t)."""
    return drive.belt_speed + drive.belt.value(time, switches)


class DriveForces:
    """Forces in a drive with its control; its constants, and the instants, may be expressions."""

    def __init__(self, drive: Drive, control: ContinuousControl | None, slots: DriveStates) -> None:
        """Take states with these slots."""
        self._drive, self._control, self._slots = drive, control, slots
        self._lags = slots.actuator.stop > slots.actuator.start

    def control_force(self, instant: Instant) -> Any:
        """Return the force on the slide, or on a motor of finite mass.

        It is held, that of the actuator, or of continuous control.
        """
        state, inputs = instant.state, instant.inputs
        if self._control is not None:
            return self._control.control_force(*self._seen(state), state[self._slots.control])
        if not self._lags:
            return inputs[0]
        force = self._drive.actuator.force(inputs[0], state[self._slots.actuator])
        return force if self._drive.motor is not None else force + inputs[1]

    def reaction(self, instant: Instant, force: Any = None) -> Any:
        """Return h = X + 2 beta X' - U - bias of the slide; the control `force` may be known."""
        state = instant.state
        if self._drive.motor is not None:
            return reaction(self._drive, *self.stretch(state), instant.inputs[1])
        force = self.control_force(instant) if force is None else force
        return reaction(self._drive, state[POSITION], state[SPEED], force)

    def motor_reaction(self, instant: Instant, relative_speed: Any) -> Any:
        """Return the reaction of the motor at a speed of it relative to the guide."""
        drive, force = self._drive, self.control_force(instant)
        assert drive.motor is not None
        stretch = self.stretch(instant.state)
        return motor_reaction(drive, drive.motor, *stretch, relative_speed, force)

    def stretch(self, state: Sequence[Any]) -> tuple[Any, Any]:
        """Return the stretch of the spring and its rate: of the slide, or against a motor."""
        x, y = state[POSITION], state[SPEED]
        if self._drive.motor is None:
            return x, y
        motor_x, motor_y = state[self._slots.motor]
        return x - motor_x, y - motor_y

    def control_rates(self, state: Sequence[Any]) -> Sequence[Any]:
        """Return the rates of the states of continuous control."""
        if self._control is None:
            return ()
        return self._control.state_rates(*self._seen(state), state[self._slots.control])

    def _seen(self, state: Sequence[Any]) -> tuple[Any, Any]:
        assert self._control is not None
        motor = state[self._slots.motor]
        return seen_by(self._control, state[POSITION], state[SPEED], motor)
