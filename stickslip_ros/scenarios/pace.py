"""How the plant is paced."""

from enum import StrEnum


class Pace(StrEnum):
    """What the plant waits for between samples: the clock, or the answer to the last one."""

    REALTIME = "realtime"
    LOCKSTEP = "lockstep"
