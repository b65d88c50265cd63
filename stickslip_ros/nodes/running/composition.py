"""The nodes of a closed loop in one process."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.logging import LoggingSeverity
from rclpy.parameter import Parameter

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.nodes.base.spinner import Spinner
from stickslip_ros.nodes.controller import ControllerNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, controller_node

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
