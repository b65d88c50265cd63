"""The nodes of a closed loop in one process, and a user's controller beside them, in a thread."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from threading import Event, Thread
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.nodes.base.spinner import Spinner, destroy
from stickslip_ros.nodes.controller import ControllerNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, controller_node

_END_TIMEOUT = 5.0

NODE_CLASSES: dict[str, Callable[..., ManagedNode[Any]]] = {
    "analyzer": AnalyzerNode,
    "plant": PlantNode,
    **{controller_node(law): partial(ControllerNode, law) for law in CONTROLLER_PARAMETERS},
}
"""Makers of the nodes of a loop, by name."""


def add_nodes(
    spinner: Spinner, parameters: Mapping[str, Mapping[str, Any]], namespace: str | None = None
) -> dict[str, Any]:
    """Make the nodes with these parameters, by node and flat name; the spinner runs them."""
    nodes: dict[str, Any] = {}
    for name, values in parameters.items():
        context = spinner.executor.context
        node = NODE_CLASSES[name](context=context, namespace=namespace, overrides=values)
        nodes[name] = node
        spinner.add(node)
    return nodes


class Composition:
    """Plant, analyzer and optionally our controller, configured, on one executor."""

    def __init__(self, spinner: Spinner, parameters: Mapping[str, Mapping[str, Any]]) -> None:
        """Make nodes with these parameters, see `add_nodes`; RunError if one refuses."""
        self.spinner = spinner
        self.nodes = add_nodes(spinner, parameters)
        """By name, in the order of activation."""
        for name, node in self.nodes.items():
            node.get_logger().set_level(LoggingSeverity.WARN)
            if node.trigger_configure() is not TransitionCallbackReturn.SUCCESS:
                raise RunError(f"{name} could not be configured; see its log")
        self.analyzer: AnalyzerNode = self.nodes["analyzer"]
        self.plant: PlantNode = self.nodes["plant"]

    def activate(self, node: ManagedNode[Any], timeout: float = 0.0) -> None:
        """Activate a node; wait up to `timeout` (s, wall time) for the nodes that it needs."""
        done = TransitionCallbackReturn.SUCCESS
        if not self.spinner.spin_until(lambda: node.trigger_activate() is done, timeout):
            reason = node.missing_peers() or "see its log"
            raise RunError(f"{node.get_name()} could not be activated: {reason}")

    def set_parameters(self, node: ManagedNode[Any], values: Mapping[str, Any]) -> None:
        """Set parameters of a node by flat name; raises InvalidInputError if it refuses them."""
        changes = [Parameter(name, value=value) for name, value in values.items()]
        result = node.set_parameters_atomically(changes)
        if not result.successful:
            raise InvalidInputError(result.reason)

    def close(self) -> None:
        """Deactivate the nodes."""
        for node in reversed(self.nodes.values()):
            if node.active:
                node.trigger_deactivate()


class ControllerThread:
    """A node on its own executor, in its own thread.

    The executor is of the usual kind, which runs every kind of callback. A managed (lifecycle)
    node that is not active is configured and activated.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.unreported = False
        """Whether the node has failed and the failure was not reported yet."""
        self._failure: BaseException | None = None
        self._idle = Event()
        self._closing = Future()
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._thread = Thread(target=self._run, name=node.get_name(), daemon=True)

    def start(self) -> None:
        """Activate the node if it is managed, and run it; raises RunError if it refuses."""
        if isinstance(self.node, LifecycleNode):
            for transition, name in (
                (self.node.trigger_configure, "configured"),
                (self.node.trigger_activate, "activated"),
            ):
                with suppress(RuntimeError):  # the node has changed its state by itself
                    result = transition()
                    if result is not TransitionCallbackReturn.SUCCESS:
                        raise RunError(
                            f"the controller {self.node.get_name()} could not be {name}: "
                            f"{result.name.lower()}"
                        )
        self._thread.start()

    def check(self) -> None:
        """Raise RunError if the node has stopped."""
        if self._failure is not None:
            self.unreported = False
            kind = type(self._failure).__name__
            raise RunError(
                f"the controller {self.node.get_name()} raised {kind}: {self._failure}"
            ) from self._failure

    def settle(self) -> None:
        """Wait, for 1 s at most, until the current callback has ended."""
        self._idle.clear()
        if self._failure is None:
            self._executor.create_task(self._idle.set)
            self._idle.wait(timeout=1.0)

    def close(self) -> None:
        """End the thread and destroy the node; raises RunError if a callback does not return."""
        # Not by a shutdown of the executor: the thread would miss it just before it waits.
        self._closing.set_result(None)
        if self._thread.ident is not None:
            self._thread.join(_END_TIMEOUT)
        self._executor.shutdown(timeout_sec=0.0)
        if self._thread.is_alive():
            raise RunError(
                f"the controller {self.node.get_name()} is still in a callback, {_END_TIMEOUT:g} s "
                "after the request to end: its thread continues"
            )
        destroy(self.node)

    def _run(self) -> None:
        try:
            self._executor.spin_until_future_complete(self._closing)
            if not self._closing.done():
                raise RuntimeError("ROS was shut down while the loop was open")
        except BaseException as error:
            if not self._closing.done():
                self.unreported = True
                self._failure = error
        finally:
            self._idle.set()
