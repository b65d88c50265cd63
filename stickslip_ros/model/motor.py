"""The motor behind the screw: a second body, between the control force and the spring."""

from dataclasses import dataclass
from typing import Any

from stickslip_ros.model.constants import constant


@dataclass(frozen=True)
class Motor:
    """A motor of finite mass, which drives the slide through the stiffness of the transmission.

    Its displacement X and that of the slide are both 0 at the reference, which moves with the feed.
    The control force u acts on it: M X'' = k (x - X) + c (x' - X') + G - c_m (X' - v_belt) + u,
    with the dry friction |G| <= F_m of its bearings and the nut, which may hold it at the guide as
    that of the slide does. A drive without one has an ideal motor: X = 0, and u acts on the slide.
    """

    mass: Any = constant(1.0, "Mass of the motor, reflected to the slide.", "kg", positive=True)
    damping: Any = constant(0.0, "Viscous damping between motor and guide.", "N s/m", at_least=0.0)
    friction: Any = constant(
        0.0, "Dry friction of the motor against the guide.", "N", at_least=0.0, simplifies=True
    )

    @property
    def sticks(self) -> bool:
        """Whether dry friction can hold the motor. The constants decide about it."""
        force = self.friction  # of the equations, an expression
        return not (isinstance(force, int | float) and force == 0.0)
