"""What counts as rounding in a dimensionless motion of a drive, so that it decides nothing.

heyoka misses an event in a step that starts on it. A mode that starts on one of its guards is
therefore moved off it, by little more than rounding: see `DriveSystem.nudge_off_guard`.
"""

from math import ulp

TIME_ROUNDING = 2.0**-49
"""Share of the time by which rounding may put a corner after an instant that is meant to be it."""

SPEED_ROUNDING = 2.0**-35
"""Change of the belt speed at a corner, or relative speed, that is rounding."""

LIFT_ROUNDING = 2.0**-40
"""Normal force, in that of the drive, that is rounding where a load takes all of it away."""

HYSTERESIS = 2.0**-45
"""Distance behind a margin of the law at which its mode ends.

The mode that follows then starts before its own guards. It also keeps rounding from leading back.
"""


def rounding_of(size: float) -> float:
    """Return what rounding may change in a sum of terms that are together of this size."""
    return 8.0 * ulp(size)


def off_speed(belt_speed: float, sign: float) -> float:
    """Return a speed that differs from that of the belt, in a direction, by rounding only."""
    return belt_speed + sign * max(ulp(belt_speed), ulp(1.0))
