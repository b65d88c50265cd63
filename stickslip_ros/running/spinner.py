"""Nodes on one executor that runs only while the caller waits."""

import time
from collections.abc import Callable
from math import inf
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future

from stickslip_ros.nodes.base.process import spin
from stickslip_ros.nodes.base.service_call import ServiceCall


class Spinner:
    """Runs its nodes until a condition holds, a timeout ends, or the wait is cut short."""

    def __init__(self, context: Context | None = None) -> None:
        self.executor: Executor = EventsExecutor(context=context)
        self.is_cut_short: Callable[[], bool] = lambda: False
        """Whether to stop waiting now."""
        self._nodes: list[Node] = []
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)

    def add(self, node: Node) -> None:
        """Add a node; `close` destroys it."""
        self._nodes.append(node)
        self.executor.add_node(node)

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
        timer = self._nodes[0].create_timer(period, look, clock=self._clock)
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

    def ask(self, call: ServiceCall, request: Any, timeout: float) -> Any:
        """Call a service and return its answer.

        Return None if the service does not appear, or does not answer, within `timeout` (s) each.
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
