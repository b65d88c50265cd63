"""Executors of this package: run nodes until a condition holds, a signal arrives or time ends.

Timers of the nodes are on monotonic clocks, to ring in time also if the system's clock is set back.
A library that was built for old systems, as rclpy's on PyPI, waits by the system's clock instead.
Such a wait takes longer by what the clock is set back, unless something wakes the executor then.
"""

import signal
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, redirect_stderr, suppress
from functools import cached_property, partial
from math import inf
from threading import Event, Thread

from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.task import Future
from rclpy.timer import Timer

_CLOCK_SET = 0.01
"""Change of the system's clock, s, after which what waits by it is woken."""

_STOP_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


class Spinner:
    """Runs its nodes until a condition holds, a timeout ends, or the wait is cut short."""

    def __init__(self, context: Context | None = None) -> None:
        with redirect_stderr(sys.__stderr__ or sys.stderr):  # pytest may have replaced it
            self.executor: Executor = EventsExecutor(context=context)
        self.is_cut_short: Callable[[], bool] = lambda: False
        """Whether to stop waiting now."""
        self._nodes: list[Node] = []

    def add(self, node: Node) -> None:
        """Add a node; `close` destroys it."""
        self._nodes.append(node)
        self.executor.add_node(node)

    @cached_property
    def clock(self) -> Clock:
        """A monotonic clock for timers of the first node."""
        return steady_clock(self._nodes[0])

    def spin_until(
        self, condition: Callable[[], bool], timeout: float = inf, period: float = 0.005
    ) -> bool:
        """Run the nodes until the condition holds, up to `timeout` (s, wall time).

        Return whether it holds. The condition is checked every `period` (s).
        """
        deadline = time.monotonic() + timeout
        due = Future()

        def look() -> None:
            if not due.done():
                due.set_result(None)

        # The executor's own timeouts do not count while there are callbacks to run.
        timer = self._nodes[0].create_timer(period, look, clock=self.clock)
        try:
            while not self.is_cut_short():
                if condition():
                    return True
                if time.monotonic() >= deadline:
                    break
                due = Future()
                spin(self.executor, due)
            return False
        finally:
            self._nodes[0].destroy_timer(timer)

    def spin_for(self, duration: float) -> None:
        """Run the nodes for `duration` (s, wall time)."""
        self.spin_until(lambda: False, duration)

    def close(self) -> None:
        """Destroy the nodes."""
        while self._nodes:
            node = self._nodes.pop()
            self.executor.remove_node(node)
            destroy(node)
        self.executor.shutdown()


def destroy(node: Node) -> None:
    """Destroy a node, and the state machine of a managed one: it would keep the middleware's."""
    node.destroy_node()
    if isinstance(node, LifecycleNode):
        node._state_machine.destroy_when_not_in_use()  # pyright: ignore[reportPrivateUsage]


def stop_on_signals(executor: Executor, *stopped: Future) -> None:
    """Let each SIGINT, SIGTERM or SIGHUP complete the next of `stopped` with None, from `executor`.

    SIGHUP stays ignored if it is, as under nohup.
    """

    def complete() -> None:
        due = next((future for future in stopped if not future.done()), None)
        if due is not None:
            due.set_result(None)

    def stop(*_: object) -> None:
        # The interrupted code may hold the lock of a future: completing it here would never end.
        executor.create_task(complete)

    for number in _STOP_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)


def ignore_stop_signals() -> None:
    """Let no further SIGINT, SIGTERM or SIGHUP kill a process that is about to end."""
    for number in _STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def signal_handlers_kept() -> Generator[None]:
    """Restore the present handlers of the signals that end or suspend a run; a context manager."""
    before = {number: signal.getsignal(number) for number in (*_STOP_SIGNALS, signal.SIGTSTP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def spin(executor: Executor, until: Future) -> None:
    """Run callbacks until the future is done; log exceptions of callbacks and continue."""
    while not until.done():
        try:
            executor.spin_until_future_complete(until, timeout_sec=0.2)
        except Exception as error:
            get_logger("stickslip_ros").error(f"{type(error).__name__}: {error}")


def steady_clock(node: Node) -> Clock:
    """Return a monotonic clock for timers of the node; its executor is woken when time is set."""
    clock = Clock(clock_type=ClockType.STEADY_TIME)
    waker = _Waker(node.create_timer(1e6, lambda: None, clock=clock))
    waker.start()
    # A method would be held weakly, and one that goes meanwhile has the next one omitted.
    node.context.on_shutdown(partial(_Waker.end, waker))
    return clock


class _Waker(Thread):
    """Wakes the executor of a node when the system's clock is set, while the node exists.

    Only then: each reset that waits for a busy executor makes it call the timers that are due once
    more, and each call puts a timer off by its period.
    """

    def __init__(self, timer: Timer) -> None:
        super().__init__(daemon=True)
        self._timer = timer
        self._ended = Event()

    def run(self) -> None:
        known = _clock_difference()
        with suppress(InvalidHandle):  # the node is destroyed
            while not self._ended.wait(0.1):
                self._timer.is_canceled()
                if abs(_clock_difference() - known) > _CLOCK_SET:
                    known = _clock_difference()
                    self._timer.reset()

    def end(self) -> None:
        """End the thread."""
        self._ended.set()
        self.join()


def _clock_difference() -> float:
    """Return the system's clock minus the monotonic one, s."""
    return time.time() - time.monotonic()
