"""What lets the plant go on to its next sample: the clock, or the answer to the last one."""

import time
from collections.abc import Callable
from math import inf
from threading import Event, Lock, Thread
from typing import Any

from stickslip_ros.nodes.managed import ManagedNode
from stickslip_ros.nodes.topics import RECORDED
from stickslip_ros.physics.sampled_loop import Sample, SampledLoop
from stickslip_ros.scenario.parameters import PlantParameters

Publish = Callable[[Sample], None]

_BATCH = 100
"""Samples that lockstep publishes in one go where nothing holds it up."""
_LONG_WAIT = 0.05
"""Wait, s, from which on it must be possible to be interrupted."""


class Pacer:
    """Drives a loop from sample to sample; `publish` gets each, `end` is called at the last."""

    complaint = ""
    """What is wrong, in words."""
    missed_deadlines = 0

    def __init__(self, loop: SampledLoop, publish: Publish, end: Callable[[], None]) -> None:
        self._loop = loop
        self._publish = publish
        self._end = end
        self._last: float = inf
        self._running = False
        self._started = self._stopped = time.monotonic()

    def start(self, last: int | None) -> None:
        """Publish sample 0 and go on, up to sample `last` if there is one."""
        self._last = inf if last is None else last
        self._running = True
        self._started = time.monotonic()
        self._publish(self._loop.sample)

    def stop(self) -> None:
        """Publish no further sample."""
        if self._running:
            self._stopped = time.monotonic()
        self._running = False

    @property
    def steps_per_second(self) -> float:
        """Samples per second of wall time since the start."""
        until = time.monotonic() if self._running else self._stopped
        return self._loop.sample.number / max(until - self._started, 1e-9)

    def force_came(self) -> None:
        """Say that a force was offered to the loop."""

    def recorder_came_to(self, stamp: int) -> None:
        """Say that the recorder holds everything up to the sample of that stamp (ns)."""


class LockstepPacer(Pacer):
    """Goes on as soon as the force has come, and not too far ahead of the recorder.

    Whoever is silent for `reply_timeout` is not waited for until it speaks again.
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
        self._reply_timeout = node.parameters.reply_timeout
        self._window = node.parameters.flow_window
        self._recorded = -1
        self._recorder_present = self._recorder_exists()
        self._scheduled = False
        self._seen = -1
        self._seen_at = 0.0
        self._watchdog = node.every(min(0.1, self._reply_timeout / 10.0), self._watch)

    def start(self, last: int | None) -> None:
        """Publish sample 0 and go on, once the node is active, when it is answered."""
        super().start(last)
        self._schedule()

    def stop(self) -> None:
        """Publish no further sample."""
        super().stop()
        self._node.destroy_timer(self._watchdog)

    def force_came(self) -> None:
        """Go on if the force was the one waited for."""
        if self._loop.answered:
            self.complaint = ""
            self._proceed()

    def recorder_came_to(self, stamp: int) -> None:
        """Go on if the recorder has caught up."""
        number = self._loop.number(stamp)
        if number <= self._loop.sample.number:
            self._recorded = max(self._recorded, number)
        self._recorder_present = True
        self._proceed()

    def _proceed(self) -> None:
        loop = self._loop
        for _ in range(_BATCH):
            if not self._running or self._awaits_force or self._awaits_recorder:
                return
            if loop.sample.number >= self._last or loop.unbounded:
                self.stop()
                self._end()
                return
            self._publish(loop.advance())
        self._schedule()

    def _schedule(self) -> None:
        """Go on behind the callbacks that are due."""
        if not self._scheduled:
            self._scheduled = True
            self._node.call_soon(self._proceed_scheduled)

    def _proceed_scheduled(self) -> None:
        self._scheduled = False
        self._proceed()

    @property
    def _awaits_force(self) -> bool:
        return self._loop.controller_present and not self._loop.answered

    @property
    def _awaits_recorder(self) -> bool:
        ahead = self._loop.sample.number - self._recorded
        return self._recorder_present and ahead >= self._window

    def _recorder_exists(self) -> bool:
        return self._node.count_publishers(RECORDED.name) > 0

    def _watch(self) -> None:
        """Give up whoever has held up the loop for too long."""
        now = time.monotonic()
        if self._loop.sample.number != self._seen:
            self._seen, self._seen_at = self._loop.sample.number, now
            return
        patience_ends = now - self._seen_at >= self._reply_timeout
        if self._awaits_recorder and (patience_ends or not self._recorder_exists()):
            self._recorder_present = False
            self._complain("the recorder is silent: not waited for any more")
        elif self._awaits_force and patience_ends:
            self._loop.controller_present = False
            self._complain("no control force comes: going on without")
        self._proceed()

    def _complain(self, complaint: str) -> None:
        self.complaint = complaint
        self._node.get_logger().warning(complaint)


class RealtimePacer(Pacer):
    """Publishes each sample at its absolute deadline on the wall clock, from a thread of its own.

    After a stall the samples that are due follow at once; each one published after the deadline
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
        super().__init__(loop, publish, end)
        self._lock = lock
        self._interval = loop.period / real_time_factor
        self._call_soon = call_soon
        self._interrupted = Event()
        self._thread = Thread(target=self._run, name="pacer", daemon=True)

    def start(self, last: int | None) -> None:
        """Publish sample 0 now; every further one is due an interval after the one before."""
        super().start(last)
        self._thread.start()

    def stop(self) -> None:
        """Publish no further sample."""
        super().stop()
        self._interrupted.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            self._keep_deadlines()
        except Exception as error:  # it would end the thread without a word
            self.complaint = f"{type(error).__name__}: {error}"
            self._call_soon(self._end)

    def _keep_deadlines(self) -> None:
        loop = self._loop
        while self._running:
            if loop.sample.number >= self._last or loop.unbounded:
                self._call_soon(self._end)
                return
            deadline = self._started + (loop.sample.number + 1) * self._interval
            self._sleep_until(deadline)
            if not self._running:
                return
            with self._lock:
                sample = loop.advance()
            self._publish(sample)
            if time.monotonic() > deadline + self._interval:
                self.missed_deadlines += 1

    def _sleep_until(self, deadline: float) -> None:
        wait = deadline - time.monotonic()
        if wait > _LONG_WAIT:
            self._interrupted.wait(wait - _LONG_WAIT)
            wait = deadline - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
