"""Pace a node by the clock, or by answers and a recorder."""

import ctypes
import gc
import sys
import time
from collections import deque
from collections.abc import Callable
from threading import TIMEOUT_MAX, Event, Lock, Thread
from typing import Any

from typing_extensions import override

from stickslip_ros.errors import StickslipError
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.record.topics import RECORDED, force_topics
from stickslip_ros.samples import Sample
from stickslip_ros.scenarios.plant_parameters import PlantParameters

Publish = Callable[[Sample], None]

_LONG_WAIT = 0.05
"""Wait, s, above which the wait must be interruptible."""

NO_FORCE = "no control force arrives: continuing without"


class Sleeper:
    """Sleeps until absolute times of the monotonic clock, or until it is woken."""

    def __init__(self) -> None:
        self._woken = Event()

    def sleep_until(self, deadline: float) -> None:
        """Return at the deadline, s, or on `wake`."""
        wait = deadline - time.monotonic()
        if wait > _LONG_WAIT:
            if self._woken.wait(min(wait - _LONG_WAIT, TIMEOUT_MAX)):
                self._woken.clear()
                return
            wait = deadline - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)

    def wake(self) -> None:
        """End the current long sleep, or else the next one. Any thread may call this."""
        self._woken.set()


class FlowWindow:
    """Bounds the number of joint states that are sent and not yet recorded.

    If the recorder has gone or is silent for too long, it is ignored until it publishes again.
    """

    def __init__(self, size: int, recorder_exists: Callable[[], bool]) -> None:
        """Allow `size` samples."""
        self._recorder_exists = recorder_exists
        self._recorder_present = recorder_exists()
        self._under_way: deque[int] = deque(maxlen=size)

    @property
    def under_way(self) -> int:
        """Samples that the recorder may not have yet; 0 without a recorder to wait for."""
        return len(self._under_way) if self._recorder_present else 0

    @property
    def full(self) -> bool:
        """Whether the recorder must progress before the next sample is sent."""
        return self.under_way == self._under_way.maxlen

    def sent(self, stamp: int) -> None:
        """Note that the sample with this stamp (ns) was sent."""
        self._under_way.append(stamp)

    def recorded(self, stamp: int) -> None:
        """Note that the recorder has everything up to the last sample with this stamp (ns)."""
        self._recorder_present = True
        newest_first = enumerate(reversed(self._under_way))
        left = next((number for number, sent in newest_first if sent == stamp), None)
        while left is not None and len(self._under_way) > left:
            self._under_way.popleft()

    def give_up(self, patience_ends: bool) -> str:
        """Stop waiting if the recorder has gone or patience ends; return the problem, if any."""
        if self._recorder_exists() and not patience_ends:
            return ""
        self._recorder_present = False
        return "the recorder has gone or is silent: no longer waiting for it"


class Pacer:
    """Drives a loop from sample to sample; calls `publish` for each and `end` at the last."""

    complaint = ""
    """Current problem, in words; empty if there is none."""
    failure = ""
    """Why it could not continue, in words."""
    finished = False
    """Whether it has stopped by itself: at the last sample, or because it could not continue."""
    missed_deadlines = 0
    largest_lateness = 0.0
    """Largest delay of a sample after its deadline, s."""

    def __init__(self, loop: SampledLoop, publish: Publish, end: Callable[[], None]) -> None:
        self._loop = loop
        self._publish = publish
        self._end = end
        self._last: float = 0
        self._running = False
        self._started = self._stopped = time.monotonic()

    def start(self, last: float) -> None:
        """Publish sample 0 and continue up to sample `last`."""
        self._last = last
        self._running = True
        self._started = time.monotonic()
        self._publish(self._loop.sample)

    def stop(self) -> None:
        """Publish no more samples."""
        if self._running:
            self._stopped = time.monotonic()
        self._running = False

    def _finish(self) -> None:
        self.finished = True
        self._end()

    @property
    def instant(self) -> float | None:
        """The present instant, in periods from the present sample; None where no clock paces."""
        return None

    @property
    def steps_per_second(self) -> float:
        """Samples per second of wall time since the start."""
        until = time.monotonic() if self._running else self._stopped
        return self._loop.sample_number / max(until - self._started, 1e-9)

    def force_came(self) -> None:
        """Note that a force was offered to the loop."""

    def recorder_came_to(self, stamp: int) -> None:
        """Note that the recorder has everything up to the sample with this stamp (ns)."""


class LockstepPacer(Pacer):
    """Continues as soon as the force has arrived, but not too far ahead of the recorder.

    A controller or recorder that is silent for `reply_timeout`, while this node runs, is ignored
    until it publishes again.
    """

    def __init__(
        self,
        loop: SampledLoop,
        publish: Publish,
        end: Callable[[], None],
        node: ManagedNode[PlantParameters],
    ) -> None:
        super().__init__(loop, publish, end)
        self._node = node
        parameters = node.parameters
        self._reply_timeout = parameters.reply_timeout
        self._holds = parameters.command_rule == "newest"
        self._silence = parameters.command_timeout if self._holds else parameters.reply_timeout
        recorded = node.resolve_topic_name(RECORDED.name)
        self._flow = FlowWindow(parameters.flow_window, lambda: node.count_publishers(recorded) > 0)
        self._scheduled = False
        self._seen = -1
        self._held_up = 0.0
        """Time, s, since the present sample was seen."""
        self._watched_at = time.monotonic()
        self._look_period = min(0.1, min(self._silence, self._reply_timeout) / 10.0)
        self._watchdog = node.every(self._look_period, self._watch)

    def start(self, last: float) -> None:
        """Publish sample 0 and, once the node is active, continue when it is answered."""
        super().start(last)
        self._flow.sent(self._loop.sample.stamp)
        self._schedule()

    def stop(self) -> None:
        """Publish no more samples."""
        super().stop()
        self._node.destroy_timer(self._watchdog)

    def _finish(self) -> None:
        self.stop()
        super()._finish()

    def force_came(self) -> None:
        """Continue if the force was the expected one."""
        if self._loop.answered:
            self._proceed()

    def recorder_came_to(self, stamp: int) -> None:
        """Continue if the recorder has caught up."""
        self._flow.recorded(stamp)
        if self.complaint:
            self._node.get_logger().info("the recorder is back: waiting for it again")
        self.complaint = ""
        self._proceed()

    def _proceed(self) -> None:
        loop = self._loop
        for _ in range(100):  # more of them after the callbacks that are due by then
            if not self._running:
                return
            if loop.unbounded:
                self._finish()
                return
            if self._awaits_force or self._awaits_recorder:
                return
            if loop.sample_number >= self._last:
                self._finish()
                return
            try:
                sample = loop.advance()
            except StickslipError as error:
                self.failure = str(error)
                self._finish()
                return
            self._publish(sample)
            self._flow.sent(sample.stamp)
        self._schedule()

    def _schedule(self) -> None:
        """Continue after the callbacks that are due."""
        if not self._scheduled:
            self._scheduled = True
            self._node.call_soon(self._proceed_scheduled)

    def _proceed_scheduled(self) -> None:
        self._scheduled = False
        self._proceed()

    @property
    def _awaits_recorder(self) -> bool:
        """Whether the recorder must progress: by one sample or, at the last, to this one."""
        at_end = self._loop.sample_number >= self._last
        return self._flow.under_way > 0 if at_end else self._flow.full

    @property
    def _awaits_force(self) -> bool:
        return self._loop.answers.controller_present and not self._loop.answered

    def _watch(self) -> None:
        """Stop waiting for a controller or recorder that has held up the loop for too long."""
        now = time.monotonic()
        # While this node could not run, what the others sent could not come.
        passed = min(now - self._watched_at, 2.0 * self._look_period)
        self._watched_at = now
        if self._loop.sample_number != self._seen:
            self._seen, self._held_up = self._loop.sample_number, 0.0
            return
        self._held_up += passed
        patience_ends = self._held_up >= self._reply_timeout
        silent = self._awaits_force and self._held_up >= self._silence
        if self._awaits_recorder and (silence := self._flow.give_up(patience_ends)):
            self.complaint = silence
            self._node.get_logger().warning(silence)
        elif silent and self._holds and self._commander_exists():
            self._loop.hold()
        elif silent and patience_ends:
            self._loop.answers.controller_present = False
        self._proceed()

    def _commander_exists(self) -> bool:
        return any(
            self._node.count_publishers(self._node.resolve_topic_name(topic.name))
            for topic in force_topics(self._node.parameters.force_type)
        )


class RealtimePacer(Pacer):
    """Publishes each sample at its absolute deadline, by the monotonic clock, from its own thread.

    After a stall the samples that are due follow immediately; each one published after the deadline
    of the next counts as a missed deadline.
    """

    def __init__(
        self,
        loop: SampledLoop,
        publish: Publish,
        end: Callable[[], None],
        lock: Lock,
        real_time_factor: float,
        call_soon: Callable[[Callable[[], None]], Any],
    ) -> None:
        """Hold `lock` while the loop advances; call `end` through `call_soon`."""
        super().__init__(loop, publish, lambda: call_soon(end))
        self._lock = lock
        self._interval = loop.period / real_time_factor
        self._sleeper = Sleeper()
        self._thread = Thread(target=self._run, name="pacer", daemon=True)

    def start(self, last: float) -> None:
        """Publish sample 0 now; each following sample is due one interval later."""
        super().start(last)
        self._thread.start()

    def stop(self) -> None:
        """Publish no more samples."""
        super().stop()
        self._sleeper.wake()
        self._thread.join()

    @property
    @override
    def instant(self) -> float | None:
        return (time.monotonic() - self.deadline(self._loop.sample_number)) / self._interval

    def deadline(self, number: int) -> float:
        """Return when a sample is due, s of the monotonic clock."""
        return self._started + number * self._interval

    def _run(self) -> None:
        try:
            _be_prompt()
            self._keep_deadlines()
        except Exception as error:  # it would end the thread silently
            known = isinstance(error, StickslipError)
            self.failure = str(error) if known else f"{type(error).__name__}: {error}"
            self._finish()

    def _keep_deadlines(self) -> None:
        loop = self._loop
        while self._running:
            if loop.sample_number >= self._last or loop.unbounded:
                self._finish()
                return
            deadline = self.deadline(loop.sample_number + 1)
            self._sleeper.sleep_until(deadline)
            if not self._running:
                return
            with self._lock:
                sample = loop.advance()
            self._publish(sample)
            lateness = time.monotonic() - deadline
            self.largest_lateness = max(self.largest_lateness, lateness)
            if lateness > self._interval:
                self.missed_deadlines += 1


def _be_prompt() -> None:
    """Reduce wake-up delays of this thread; the defaults favour throughput."""
    if sys.platform == "linux":  # otherwise a sleep may last 50 us longer
        ctypes.CDLL(None).prctl(29, 1)  # PR_SET_TIMERSLACK
    sys.setswitchinterval(1e-4)
    gc.freeze()  # objects made by imports take tens of ms to traverse
