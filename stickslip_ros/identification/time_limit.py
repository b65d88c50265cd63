"""The processor time that the choice of a law may take."""

import time
from math import inf


class OutOfTimeError(Exception):
    """The time of a stage is over."""


class TimeLimit:
    """Processor time from now on, of this thread, divided into stages.

    Results do not depend on what else the machine does.
    """

    def __init__(self, seconds: float = inf) -> None:
        """Take the time, s; the first stage has all of it."""
        self._end = self._end_of_stage = self._end_of_part = time.thread_time() + seconds

    def begin_stage(self, share: float) -> None:
        """Begin a stage that has a share of what is left."""
        now = time.thread_time()
        self._end_of_stage = self._end_of_part = now + share * max(self._end - now, 0.0)

    def begin_part(self, share: float) -> None:
        """Begin a part of the stage that has a share of what is left of it."""
        now = time.thread_time()
        self._end_of_part = now + share * max(self._end_of_stage - now, 0.0)

    @property
    def is_over(self) -> bool:
        """Whether the time of the part, or of a stage without parts, is over."""
        return time.thread_time() >= self._end_of_part
