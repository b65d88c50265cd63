"""Monotonic clocks for timers of nodes, which ring in time also if the system's clock is set back.

A library that was built for old systems, as rclpy's on PyPI, waits by the system's clock instead.
Such a wait takes longer by what the clock is set back, unless something else wakes the executor.
"""

from contextlib import suppress
from functools import partial
from threading import Event, Thread

from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.timer import Timer


def steady_clock(node: Node) -> Clock:
    """Return a monotonic clock for timers of the node; its executor is woken ten times a second."""
    clock = Clock(clock_type=ClockType.STEADY_TIME)
    waker = _Waker(node.create_timer(1e6, lambda: None, clock=clock))
    waker.start()
    # A method would be held weakly, and one that goes meanwhile has the next one omitted.
    node.context.on_shutdown(partial(_Waker.end, waker))
    return clock


class _Waker(Thread):
    """Wakes the executor of a node until the node is destroyed or its context is shut down."""

    def __init__(self, timer: Timer) -> None:
        super().__init__(daemon=True)
        self._timer = timer
        self._ended = Event()

    def run(self) -> None:
        with suppress(InvalidHandle):  # the node is destroyed
            while not self._ended.wait(0.1):
                self._timer.reset()

    def end(self) -> None:
        """End the thread."""
        self._ended.set()
        self.join()
