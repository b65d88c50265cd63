"""Deadlines of recorded messages in a replay."""

from stickslip_ros.stamps import NANOSECONDS

JITTER = NANOSECONDS
"""Time, ns, by which log times may go back without starting a new segment."""


class Timeline:
    """Turns log times into absolute deadlines, which do not drift after a late message.

    A message that was logged before an earlier one is due at the same time as that. If log times go
    back by more than JITTER, a new segment starts, one interval after the old one.
    """

    def __init__(self, rate: float = 1.0) -> None:
        """Let recorded time pass `rate` times as fast as wall time."""
        self._seconds = 1e-9 / rate
        self._origin = 0.0
        self._zero: int | None = None
        self.now = 0
        """The newest log time of the segment, ns."""
        self._interval = NANOSECONDS
        self._segment_starts = False
        self._paused_at: float | None = None

    @property
    def deadline(self) -> float:
        """When the message of the last `go_to` is due, s of the clock of its `now`."""
        return self._origin + self.elapsed_at(self.now) * self._seconds

    @property
    def paused(self) -> bool:
        """Whether the time is stopped."""
        return self._paused_at is not None

    def elapsed_at(self, log_time: int) -> int:
        """Return the recorded time, ns, from the first message to a log time of the segment."""
        return log_time - (self._zero or 0)

    def go_to(self, log_time: int, now: float = 0.0) -> None:
        """Proceed to a log time (ns); the very first message is due `now` (s)."""
        if self._zero is None:
            self._origin = now
            self._zero = self.now = log_time
        elif self._segment_starts or log_time < self.now - JITTER:
            self._zero = log_time - self.elapsed_at(self.now) - self._interval
            self.now = log_time
        elif log_time > self.now:
            self._interval = log_time - self.now
            self.now = log_time
        self._segment_starts = False

    def start_segment(self) -> None:
        """Start a new segment with the next message."""
        self._segment_starts = True

    def pause(self, now: float) -> None:
        """Stop the time at `now` (s)."""
        if self._paused_at is None:
            self._paused_at = now

    def resume(self, now: float) -> None:
        """Continue the time at `now` (s); deadlines move by the length of the pause."""
        if self._paused_at is not None:
            self._origin += now - self._paused_at
            self._paused_at = None
