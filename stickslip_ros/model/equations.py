"""The equations of motion, eq. 5.

They are written once, for floats, arrays and heyoka expressions: a drive may have expressions for
its constants. The integrator of the motion and all derivatives are compiled from them.
"""

from collections.abc import Sequence
from typing import Any

from stickslip_ros.model.drive import Drive
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
