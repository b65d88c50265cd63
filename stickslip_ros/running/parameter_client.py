"""Setting parameters of nodes that run, over their services."""

from collections.abc import Mapping
from contextlib import closing
from typing import Any

import rclpy
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from stickslip_ros.errors import RunError
from stickslip_ros.nodes.base.process import initialise
from stickslip_ros.nodes.base.service_call import ServiceCall
from stickslip_ros.running.spinner import Spinner

_DISCOVERY_TIME = 5.0
"""Wall time, s, within which a node that runs is found."""

_ANSWER_TIME = 10.0


class NodeNotFoundError(RunError):
    """No node of that name runs."""


def set_parameters(namespace: str, values: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Set parameters of running nodes; return the refusals by node.

    `values` are by node, whose name is relative to the namespace, and by flat name; all those of a
    node are set together, or none. Nothing is set unless every node is found: otherwise this raises
    NodeNotFoundError, and RunError for a node that does not answer.
    """
    initialise()
    try:
        node = Node(
            "parameter_client",
            namespace=namespace,
            enable_rosout=False,
            start_parameter_services=False,
        )
        spinner = Spinner()
        spinner.add(node)
        with closing(spinner):
            for name in values:
                if not spinner.spin_until(
                    lambda name=name: node.count_services(_service(node, name)) > 0,
                    _DISCOVERY_TIME,
                ):
                    raise NodeNotFoundError(_not_found(node, name))
            answers = {name: _set(spinner, node, name, new) for name, new in values.items()}
    finally:
        rclpy.try_shutdown()
    return {name: reason for name, reason in answers.items() if reason}


def _service(node: Node, name: str) -> str:
    return f"{_full_name(node, name)}/set_parameters_atomically"


def _full_name(node: Node, name: str) -> str:
    return f"{node.get_namespace().rstrip('/')}/{name}"


def _not_found(node: Node, name: str) -> str:
    elsewhere = sorted(
        f"{namespace.rstrip('/')}/{found}"
        for found, namespace in node.get_node_names_and_namespaces()
        if found == name
    )
    what = f"no node {_full_name(node, name)} is running"
    return f"{what}; running: {', '.join(elsewhere)}" if elsewhere else what


def _set(spinner: Spinner, node: Node, name: str, values: Mapping[str, Any]) -> str:
    """Return why the node refuses the values, nothing where it has taken them."""
    parameters = [_parameter(parameter, value) for parameter, value in values.items()]
    call = ServiceCall(node, SetParametersAtomically, _service(node, name))
    request = SetParametersAtomically.Request(
        parameters=[parameter.to_parameter_msg() for parameter in parameters]
    )
    answer = spinner.ask(call, request, _ANSWER_TIME)
    if answer is None:
        raise RunError(f"the node {_full_name(node, name)} does not answer")
    return "" if answer.result.successful else answer.result.reason or "refused without a reason"


def _parameter(name: str, value: Any) -> Parameter:
    if isinstance(value, list):  # of an empty one ROS cannot know the type
        return Parameter(name, Parameter.Type.STRING_ARRAY, value)
    return Parameter(name, value=value)
