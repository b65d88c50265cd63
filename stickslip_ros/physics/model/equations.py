"""The equations of motion, eq. 5.

They are written once, for floats, arrays and heyoka expressions: a drive may have expressions for
its constants. The integrator of the motion and all derivatives are compiled from them.
"""

from collections.abc import Sequence
from typing import Any

from stickslip_ros.physics.model.drive import Drive


def reaction(drive: Drive, position: Any, velocity: Any, force: Any) -> Any:
    """Return h = k x + c x' - u - bias: friction of this force leaves the slide no acceleration."""
    return drive.stiffness * position + drive.damping * velocity - force - drive.bias_force


def acceleration(drive: Drive, friction_force: Any, reaction: Any) -> Any:
    """Return x'' = (F - h)/m, eq. 5, with the friction force F = N mu(x' - v_belt)."""
    return (friction_force - reaction) / drive.mass


def normal_force(drive: Drive, time: Any, switches: Sequence[Any] = ()) -> Any:
    """Return the normal force N(t), with the load."""
    return drive.normal_force + drive.load.value(time, switches)


def belt_speed(drive: Drive, time: Any, switches: Sequence[Any] = ()) -> Any:
    """Return the speed of the belt v_belt(t)."""
    return drive.belt_speed + drive.belt.value(time, switches)
