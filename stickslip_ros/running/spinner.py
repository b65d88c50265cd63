"""Nodes on one executor that runs only while the caller waits."""

import time
from collections.abc import Callable
from math import inf
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.task import Future

from stickslip_ros.nodes.base.process import spin
from stickslip_ros.nodes.base.service_call import ServiceCall
from stickslip_ros.nodes.base.steady_clock import steady_clock


class Spinner:
    """Runs its nodes until a condition holds, a timeout ends, or the wait is cut short."""

    def __init__(self, context: Context | None = None) -> None:
        self.executor: Executor = EventsExecutor(context=context)
        self.is_cut_short: Callable[[], bool] = lambda: False
        """Whether to stop waiting now."""
        self._nodes: list[Node] = []

    def add(self, node: Node) -> None:
        """Add a node; `close` destroys it."""
        if not self._nodes:
            self.clock = steady_clock(node)
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
            destroy(node)
        self.executor.shutdown()


def destroy(node: Node) -> None:
    """Destroy a node, and the state machine of a managed one: it would keep the middleware's."""
    node.destroy_node()
    if isinstance(node, LifecycleNode):
        node._state_machine.destroy_when_not_in_use()  # pyright: ignore[reportPrivateUsage]
