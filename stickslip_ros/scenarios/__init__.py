"""Parameters of the nodes, and the scenario files that give their values."""

from enum import StrEnum

DEFAULT_NAMESPACE = "/feed_drive"
LONGEST_NAMESPACE = 200
"""Characters of a namespace with which all topic and service names are short enough for ROS."""


def full_name(namespace: str, node: str) -> str:
    """Return the full name of a node in a namespace."""
    return f"{namespace.rstrip('/')}/{node}"


class Pace(StrEnum):
    """Condition of the next sample: the time by the clock, or the answer to the last sample."""

    REALTIME = "realtime"
    LOCKSTEP = "lockstep"
