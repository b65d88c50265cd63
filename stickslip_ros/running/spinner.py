"""Nodes on one executor, run only while somebody waits for something."""

import time
from collections.abc import Callable
from math import inf
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future

from stickslip_ros.nodes.base.process import spin
from stickslip_ros.nodes.base.service_call import ServiceCall

_LOOK_PERIOD = 0.005


class Spinner:
    """Runs its nodes until a condition holds, time is over, or waiting is cut short."""

    def __init__(self, context: Context | None = None) -> None:
        self.executor: Executor = EventsExecutor(context=context)
        self.cut_short = Future()
        """As long as this is done, nothing is waited for."""
        self._nodes: list[Node] = []

    def add(self, node: Node) -> None:
        """Run a node, too; `close` destroys it."""
        self._nodes.append(node)
        self.executor.add_node(node)

    def spin_until(
        self, condition: Callable[[], bool], timeout: float = inf, period: float = _LOOK_PERIOD
    ) -> bool:
        """Run the nodes until the condition holds, for so much wall time (s); return if it does.

        The condition is looked at every `period` (s).
        """
        deadline = time.monotonic() + timeout
        while not self.cut_short.done():
            if condition():
                return True
            if time.monotonic() >= deadline:
                break
            self.spin_for(period)
        return False

    def spin_for(self, duration: float) -> None:
        """Run the nodes for so much wall time (s)."""
        spin(self.executor, self.cut_short, duration)

    def wait_for(self, future: Future) -> None:
        """Run the nodes until a future is done."""
        spin(self.executor, first_of(future, self.cut_short))

    def ask(self, call: ServiceCall, request: Any, timeout: float) -> Any:
        """Call a service and return its answer.

        None if it is not there, or does not answer, within so much wall time (s) each.
        """
        call.start(request)
        if self.spin_until(lambda: call.pursue() or call.sent, timeout):
            self.spin_until(call.pursue, timeout)
        return call.answer

    def close(self) -> None:
        """Destroy the nodes."""
        for node in reversed(self._nodes):
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()


def first_of(*futures: Future) -> Future:
    """Return a future that is done as soon as one of these is."""
    first = Future()

    def finish(_: Future) -> None:
        if not first.done():
            first.set_result(None)

    for future in futures:
        future.add_done_callback(finish)
    return first
