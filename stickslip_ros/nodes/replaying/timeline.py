"""When recorded messages are due again."""

from stickslip_ros.stamps import NANOSECONDS

JITTER = NANOSECONDS
"""Time, ns, by which log times may go back without a new segment beginning there."""


class Timeline:
    """Turns log times into absolute deadlines: none drifts, however late the one before was met.

    Nothing waits for the past: what was logged before what came earlier is due along with it. Where
    log times go back by more than JITTER a new segment begins, one interval behind the old one.
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
        """When what `go_to` went to is due, s of the clock that its `now` was read from."""
        return self._origin + self.elapsed_at(self.now) * self._seconds

    @property
    def paused(self) -> bool:
        """Whether time stands still."""
        return self._paused_at is not None

    def elapsed_at(self, log_time: int) -> int:
        """Return the recorded time, ns, from what was first of all to a log time of the segment."""
        return log_time - (self._zero or 0)

    def go_to(self, log_time: int, now: float = 0.0) -> None:
        """Go on to what was logged at that time (ns); what is first of all is due `now` (s)."""
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
        """Take what comes next for the begin of a new segment."""
        self._segment_starts = True

    def pause(self, now: float) -> None:
        """Let time stand still from `now` (s) on."""
        if self._paused_at is None:
            self._paused_at = now

    def resume(self, now: float) -> None:
        """Let time go on `now` (s); every deadline moves by the length of the pause."""
        if self._paused_at is not None:
            self._origin += now - self._paused_at
            self._paused_at = None
