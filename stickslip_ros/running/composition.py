"""Our nodes of a closed loop in this process, run only while somebody waits for something."""

import sys
import time
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.logging import LoggingSeverity
from rclpy.parameter import Parameter
from rclpy.task import Future

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.nodes.base.process import spin
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode

_LOOK_PERIOD = 0.005


class Composition:
    """Plant, analyzer and perhaps our controller, configured, on one executor."""

    def __init__(
        self, context: Context, parameters: Mapping[str, Mapping[str, Any]], *, washout: bool
    ) -> None:
        """Make the nodes with these parameters, by node and flat name; RunError if one refuses."""
        with redirect_stderr(sys.__stderr__):  # it asks for a file, which pytest may not have there
            self._executor: Executor = EventsExecutor(context=context)
        self.nodes: dict[str, ManagedNode[Any]] = {}
        """By name, in the order of activation."""
        try:
            self.analyzer = self._add(AnalyzerNode, context, parameters["analyzer"])
            if washout:
                self._add(WashoutControllerNode, context, parameters["washout_controller"])
            self.plant = self._add(PlantNode, context, parameters["plant"])
        except BaseException:
            self.close()
            raise

    def activate(self, node: ManagedNode[Any], timeout: float = 0.0) -> None:
        """Activate a node, within so much wall time (s) in which those it waits for may come."""

        def activated() -> bool:
            return node.trigger_activate() is TransitionCallbackReturn.SUCCESS

        if not self.spin_until(activated, timeout):
            reason = node.missing_peers() or "its log says why"
            raise RunError(f"{node.get_name()} could not be activated: {reason}")

    def set_parameters(self, node: ManagedNode[Any], values: Mapping[str, Any]) -> None:
        """Set parameters of a node by their flat names; raises InvalidInputError if it refuses."""
        changes = [Parameter(name, value=value) for name, value in values.items()]
        result = node.set_parameters_atomically(changes)
        if not result.successful:
            raise InvalidInputError(result.reason)

    def spin_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Run the nodes until the condition holds, for so much wall time (s); return if it does."""
        deadline = time.monotonic() + timeout
        while not condition():
            if time.monotonic() >= deadline:
                return False
            self._spin_for(_LOOK_PERIOD)
        return True

    def ask(self, kind: Any, service: str, request: Any, timeout: float) -> Any:
        """Call a service and return its answer, None if none comes within so much wall time (s)."""
        client = self.plant.create_client(kind, service)
        try:
            if not self.spin_until(client.service_is_ready, timeout):
                return None
            answer = client.call_async(request)
            self.spin_until(answer.done, timeout)
            return answer.result()
        finally:
            self.plant.destroy_client(client)

    def close(self) -> None:
        """Deactivate and destroy the nodes."""
        for node in reversed(self.nodes.values()):
            if node.active:
                node.trigger_deactivate()
            self._executor.remove_node(node)
            node.destroy_node()
        self._executor.shutdown()

    def _add(
        self, make: Callable[..., Any], context: Context, parameters: Mapping[str, Any]
    ) -> Any:
        node = make(context=context, overrides={**parameters, "autostart": False})
        node.get_logger().set_level(LoggingSeverity.WARN)
        self.nodes[node.get_name()] = node
        self._executor.add_node(node)
        if node.trigger_configure() is not TransitionCallbackReturn.SUCCESS:
            raise RunError(f"{node.get_name()} could not be configured; its log says why")
        return node

    def _spin_for(self, duration: float) -> None:
        over = Future()
        timer = self.plant.every(duration, lambda: over.done() or over.set_result(None))
        spin(self._executor, over)
        self.plant.destroy_timer(timer)
