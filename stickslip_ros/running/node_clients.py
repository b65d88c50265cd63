"""Ask nodes that run, in any process: states and transitions of managed ones, and parameters."""

from collections.abc import Callable, Mapping
from contextlib import closing
from math import inf
from time import monotonic
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from stickslip_ros.errors import RunError
from stickslip_ros.nodes.base.process import initialise
from stickslip_ros.nodes.base.service_call import ServiceCall
from stickslip_ros.running.spinner import Spinner

ACTIVE = "active"

NEXT_TRANSITION = {
    "unconfigured": Transition.TRANSITION_CONFIGURE,
    "inactive": Transition.TRANSITION_ACTIVATE,
}
"""The next transition from a state towards the active one."""

_STATE_AFTER = {
    Transition.TRANSITION_CONFIGURE: "inactive",
    Transition.TRANSITION_ACTIVATE: ACTIVE,
    Transition.TRANSITION_DEACTIVATE: "inactive",
}

_PARTICIPLE = {"unconfigured": "configured", "inactive": "activated"}

_DISCOVERY_TIME = 5.0
"""Wall time, s, within which a node that runs is found."""

_ANSWER_TIME = 10.0


class LifecycleClient:
    """Requests the state of a managed node, and transitions."""

    def __init__(self, spinner: Spinner, node: Node, name: str, answer_timeout: float) -> None:
        """Prepare requests to the managed node `name`, through `node`, which the spinner runs.

        `answer_timeout` is the wall time (s) for each answer.
        """
        self.name = name
        self._spinner = spinner
        self._timeout = answer_timeout
        self._get_state = ServiceCall(node, GetState, f"{name}/get_state")
        # No second request: it would be invalid while the transition is in progress.
        self._change_state = ServiceCall(node, ChangeState, f"{name}/change_state", answer_time=inf)

    def state(self) -> str:
        """Return the name of the node's state, empty if it does not answer."""
        answer = self._spinner.ask(self._get_state, GetState.Request(), self._timeout)
        return answer.current_state.label if answer is not None else ""

    def change_state(self, transition: int) -> bool:
        """Request a transition; return whether the node has made it.

        If the last request was not answered, it is repeated only in a state that shows that it had
        no effect: the answer may be lost, or the transition still in progress.
        """
        if self._change_state.sent and self._change_state.answer is None:
            state = self.state()
            if state == _STATE_AFTER[transition] or state not in NEXT_TRANSITION:
                return state == _STATE_AFTER[transition]
        self._spinner.ask(self._change_state, _request(transition), self._timeout)
        return self.changed

    def start_change(self, transition: int) -> None:
        """Request a transition and do not wait for the answer: see `change_ended`."""
        self._change_state.start(_request(transition))

    @property
    def changed(self) -> bool:
        """Whether the node has made the last transition requested."""
        answer = self._change_state.answer
        return answer is not None and answer.success

    def change_ended(self) -> bool:
        """Send the request if that is due; return whether it was answered."""
        return self._change_state.pursue()

    def bring_up(self, timeout: float, check: Callable[[], None]) -> None:
        """Configure and activate the node unless it does so by itself.

        `check` is called repeatedly meanwhile; its exceptions propagate. Raises RunError if the
        node refuses, or is not active within `timeout` (s, wall time).
        """
        deadline = monotonic() + timeout
        asked: list[str] = []
        while (state := self.state()) != ACTIVE:
            check()
            if state in asked or state == "finalized":
                done = _PARTICIPLE[asked[-1]] if asked else "brought up"
                raise RunError(f"the controller {self.name} could not be {done}; see its log")
            if monotonic() >= deadline:
                raise RunError(f"the controller {self.name} was not active within {timeout:g} s")
            # It may proceed to its next state by itself.
            if state in NEXT_TRANSITION and not self._spinner.spin_until(
                lambda before=state: self.state() != before, timeout=1.0
            ):
                asked.append(state)
                self.change_state(NEXT_TRANSITION[state])


def _request(transition: int) -> ChangeState.Request:
    return ChangeState.Request(transition=Transition(id=transition))


class NodeNotFoundError(RunError):
    """No node of that name runs."""


def set_parameters(
    namespace: str, values: Mapping[str, Mapping[str, Any]]
) -> dict[str, SetParametersResult]:
    """Set parameters of running nodes; return their answers by node.

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
            return {name: _set(spinner, node, name, new) for name, new in values.items()}
    finally:
        rclpy.try_shutdown()


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


def _set(spinner: Spinner, node: Node, name: str, values: Mapping[str, Any]) -> SetParametersResult:
    parameters = [_parameter(parameter, value) for parameter, value in values.items()]
    call = ServiceCall(node, SetParametersAtomically, _service(node, name))
    request = SetParametersAtomically.Request(
        parameters=[parameter.to_parameter_msg() for parameter in parameters]
    )
    answer = spinner.ask(call, request, _ANSWER_TIME)
    if answer is None:
        raise RunError(f"the node {_full_name(node, name)} does not answer")
    return answer.result


def _parameter(name: str, value: Any) -> Parameter:
    if isinstance(value, list):  # of an empty one ROS cannot know the type
        return Parameter(name, Parameter.Type.STRING_ARRAY, value)
    return Parameter(name, value=value)
