"""Options of studies and their defaults.

Commands show these in their help, so importing this module loads neither numpy nor heyoka.
"""

from dataclasses import dataclass
from enum import StrEnum

from stickslip_ros.errors import InvalidInputError

LONGEST = 1e6
"""Largest number of natural periods or cycles of one motion."""


@dataclass(frozen=True)
class SettlingOptions:
    """How long a motion is simulated until it is measured.

    Raises
    ------
    InvalidInputError
        If a value is out of range.
    """

    transient: float = 200.0
    """Transient that is skipped, in natural periods, 0 to 1e6. The first loading of the spring by a
    slow belt and, under control, `start_after` are added to it."""
    cycles: int = 4
    """Number of whole cycles that are then measured, if there are any, 1 to 1e6."""
    patience: int = 1
    """Largest number of repetitions of both, 1 to 1e6. They end when the motion is steady and two
    results are the same: near an unstable cycle a motion may seem steady for a while."""
    extensions: int = 4
    """Largest number of further repetitions, 0 to 1e6, while the cycles are alike but their
    amplitude tends to another value, as near a Hopf bifurcation."""

    def __post_init__(self) -> None:
        for shown, value, least in (
            (f"a transient of {self.transient:g} natural periods", self.transient, 0),
            (f"{self.cycles} cycles to measure", self.cycles, 1),
            (f"a patience of {self.patience} transients", self.patience, 1),
            (f"{self.extensions} extensions", self.extensions, 0),
        ):
            if not least <= value <= LONGEST:
                raise InvalidInputError(f"{shown}: must be from {least} to {LONGEST:g}")


DEFAULT_PERIODS = 200.0
"""Default duration of a simulation, in natural periods."""

BASIN_OPTIONS = SettlingOptions(transient=50.0, patience=80)
"""Default settling of a basin study: short at first, since most motions are steady soon."""

BASIN_COUNT = 40
"""Default number of positions and of velocities in a grid of starts."""

OWN_SPEED_RANGE = 0.1
"""Default half width of the speed range, as a share of the scenario's belt speed."""


class Continuation(StrEnum):
    """Direction along an axis in which each point starts from the end of its neighbour."""

    UP = "up"
    """From the first value of the axis to the last."""
    DOWN = "down"
    """From the last value to the first."""
    BOTH = "both"
    """Up, then down in a chain of its own: a difference between the two shows hysteresis."""

    @property
    def directions(self) -> tuple["Continuation", ...]:
        """UP, DOWN, or both."""
        return (Continuation.UP, Continuation.DOWN) if self is Continuation.BOTH else (self,)


FEED_TOLERANCE, POSITION_TOLERANCE = 0.05, 0.001
"""Default tolerance, as a share: of the belt speed, or of the motion of the reference."""
