"""Options of studies and their defaults.

Commands show these in their help, so importing this module loads neither numpy nor heyoka.
"""

from dataclasses import dataclass
from enum import StrEnum

from stickslip_ros.errors import InvalidInputError

LONGEST = 1e6
"""Natural periods or cycles that a motion is followed for at most."""


@dataclass(frozen=True)
class SettlingCourse:
    """How long a motion is followed."""

    transient: float = 200.0
    """Natural periods that are passed over, besides the time in which a slow belt loads the spring
    at first, and, under control, `start_after`."""
    cycles: int = 4
    """Whole cycles that are then measured, where there are any."""
    patience: int = 1
    """How often both may be done, one after the other, until the motion is steady and what is
    measured twice the same: near an unstable cycle it may seem steady for a while."""

    def __post_init__(self) -> None:
        for shown, value, least in (
            (f"a transient of {self.transient:g} natural periods", self.transient, 0),
            (f"{self.cycles} cycles to measure", self.cycles, 1),
            (f"a patience of {self.patience} transients", self.patience, 1),
        ):
            if not least <= value <= LONGEST:
                raise InvalidInputError(f"{shown}: must be from {least} to {LONGEST:g}")


BASIN_COURSE = SettlingCourse(transient=50.0, patience=80)
"""How long a motion is followed to find its basin: most are steady soon."""

OWN_SPEED_RANGE = 0.1
"""Share of its belt speed by which the design for a scenario covers lower and higher speeds."""


class Carry(StrEnum):
    """In which order along an axis each point begins where its neighbour ended."""

    UP = "up"
    """From the first value of the axis to the last."""
    DOWN = "down"
    """From the last value to the first."""
    BOTH = "both"
    """Up, and then down from the values' end anew: where the two differ there is hysteresis."""

    @property
    def directions(self) -> tuple["Carry", ...]:
        """UP, DOWN, or the two."""
        return (Carry.UP, Carry.DOWN) if self is Carry.BOTH else (self,)
