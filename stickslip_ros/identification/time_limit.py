"""The work that the choice of a law may take, in processor time of a usual machine."""

from math import inf


class OutOfTimeError(Exception):
    """The time of a stage is over."""


class TimeLimit:
    """Time from now on, divided into stages, that passes with the work that is done.

    No clock is read: the same recordings have the same result on every machine, whatever else it
    does.
    """

    def __init__(self, seconds: float = inf) -> None:
        """Take the time, s; the first stage has all of it."""
        self._now = 0.0
        self._end = self._end_of_stage = self._end_of_part = seconds

    def spend(self, seconds: float) -> None:
        """Let the time pass that some work usually takes, s."""
        self._now += seconds

    def begin_stage(self, share: float) -> None:
        """Begin a stage that has a share of what is left."""
        self._end_of_stage = self._now + share * max(self._end - self._now, 0.0)
        self._end_of_part = self._end_of_stage

    def begin_part(self, share: float) -> None:
        """Begin a part of the stage that has a share of what is left of it."""
        self._end_of_part = self._now + share * max(self._end_of_stage - self._now, 0.0)

    @property
    def is_over(self) -> bool:
        """Whether the time of the part, or of a stage without parts, is over."""
        return self._now >= self._end_of_part
