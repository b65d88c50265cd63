"""Send recorded messages again, each when it is due, from a separate thread; their deadlines."""

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from threading import Condition, Thread

from stickslip_ros.errors import MessageError, RunError, StickslipError
from stickslip_ros.nodes.pacing import FlowWindow, Sleeper
from stickslip_ros.record.codec import unpack_header
from stickslip_ros.stamps import NANOSECONDS

JITTER = NANOSECONDS
"""Time, ns, by which log times may go back without starting a new segment."""

_PATIENCE = 10.0
"""Wall time, s, to wait for a silent recorder, and at the end for the readers."""
_LOOK_AGAIN = 0.02

Message = tuple[str, int, bytes]
"""Topic, log time in ns, and the serialized message."""


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
            self._paused_at = now if self.paused else None
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


class Player:
    """Sends messages when they are due; after a stall, overdue ones follow immediately in order."""

    def __init__(
        self,
        messages: Callable[[], Iterable[Message]],
        send: Callable[[Message, int], None],
        delivered: Callable[[], bool],
        end: Callable[[], None],
        *,
        rate: float,
        loop: bool,
        windows: Mapping[str, FlowWindow],
    ) -> None:
        """Send the `messages`, repeatedly if `loop`; call `end` when all are `delivered`.

        `send` gets each message and the recorded time, ns. `windows` bounds, by topic, how many
        messages may be on their way. All functions are called from the player's thread.
        """
        self.sent = 0
        """Messages sent."""
        self.worst_lateness = 0.0
        """Largest delay of a message after its deadline, s."""
        self.complaint = ""
        """Current problem, in words; empty if there is none."""
        self.failure: StickslipError | None = None
        """The error that ended the replay early."""
        self._messages = messages
        self._send = send
        self._end = end
        self._delivered = delivered
        self._loop = loop
        self._windows = windows
        self._timeline = Timeline(rate)
        self._sleeper = Sleeper()
        self._changed = Condition()
        self._running = True
        self._thread = Thread(target=self._run, name="player", daemon=True)

    @property
    def paused(self) -> bool:
        """Whether it is paused."""
        return self._timeline.paused

    def start(self) -> None:
        """Send the first message now, unless that is done."""
        if self._thread.ident is None:
            self._thread.start()

    def stop(self) -> None:
        """Send no more messages."""
        with self._changed:
            self._running = False
            self._changed.notify()
        self._sleeper.wake()
        if self._thread.ident is not None:
            self._thread.join()

    def pause(self) -> None:
        """Pause now."""
        with self._changed:
            self._timeline.pause(time.monotonic())

    def resume(self) -> None:
        """Continue after a pause."""
        with self._changed:
            self._timeline.resume(time.monotonic())
            self._changed.notify()

    def recorder_came_to(self, topic: str, stamp: int) -> None:
        """Note that the recorder has the messages of a topic up to this stamp (ns)."""
        with self._changed:
            self._windows[topic].recorded(stamp)
            self.complaint = ""
            self._changed.notify()

    def _run(self) -> None:
        try:
            self._play()
        except StickslipError as error:
            self.failure = error
        except Exception as error:  # it would end the thread silently
            self.failure = RunError(f"the replay failed: {type(error).__name__}: {error}")
        if self._running:
            self._end()

    def _play(self) -> None:
        while True:
            # The next message is fetched before the sleep until its deadline.
            for message in self._messages():
                with self._changed:
                    self._timeline.go_to(message[1], time.monotonic())
                self._send_when_due(message)
                if not self._running:
                    return
            if not self._loop:
                self._await_delivery()
                return
            self._timeline.start_segment()

    def _await_delivery(self) -> None:
        patience_ends = time.monotonic() + _PATIENCE
        with self._changed:
            while self._running and time.monotonic() < patience_ends:
                behind = [w for w in self._windows.values() if w.under_way > 0]
                if not behind and self._delivered():
                    return
                for window in behind:
                    window.give_up(patience_ends=False)
                self._changed.wait(_LOOK_AGAIN)
            if self._running:
                self.complaint = "not every reader has received all messages"

    def _send_when_due(self, message: Message) -> None:
        topic, _, data = message
        window = self._windows.get(topic)
        while True:
            self._sleeper.sleep_until(self._timeline.deadline)
            with self._changed:
                if not self._running:
                    return
                if self._timeline.paused:
                    self._changed.wait()
                    continue
                now = time.monotonic()
                lateness = now - self._timeline.deadline
                if lateness < 0.0:
                    continue
                if window is not None and window.full:
                    self._await_recorder(window)
                    continue
                self._send(message, self._timeline.now)
                self.sent += 1
                self.worst_lateness = max(self.worst_lateness, lateness)
                if window is not None:
                    with suppress(MessageError):  # without a stamp, the recorder cannot name it
                        window.sent(unpack_header(data))
                return

    def _await_recorder(self, window: FlowWindow) -> None:
        since = time.monotonic()
        while self._running and window.full:
            self._changed.wait(_LOOK_AGAIN)
            silence = window.give_up(time.monotonic() - since > _PATIENCE)
            self.complaint = silence or self.complaint
