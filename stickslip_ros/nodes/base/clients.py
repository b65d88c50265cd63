"""Ask nodes that run, in any process: their services, states, transitions and parameters.

An answer arrives even if the middleware is slow or loses messages.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from math import inf
from typing import Any, Self

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.task import Future

from stickslip_ros.errors import RunError
from stickslip_ros.nodes.base.process import ros_session
from stickslip_ros.nodes.base.spinner import Spinner
from stickslip_ros.scenarios import full_name
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS

ANSWER_TIME = 1.0
"""Time, s, for a client to match an existing service, and then to get its answer."""

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

_PATIENCE = 15.0
"""Wall time, s, without an answer or an effect after which a transition is requested again."""

OnAnswer = Callable[[Any], None]
"""Called with the answer of a service."""


class ServiceCall:
    """Calls a service as soon as it exists, until it has answered.

    A client may never match an existing service, and an answer may be lost. Then a new client
    repeats the request, and has twice the time. So the service may get the request more than once.
    The earlier clients stay: to answer one that is gone takes a service 0.1 s, and it complains.
    """

    def __init__(
        self, node: Node, kind: Any, service: str, *, answer_time: float = ANSWER_TIME
    ) -> None:
        """Prepare to call a service through `node`; the first answer may take `answer_time` (s)."""
        self._node = node
        self._kind = kind
        self._service = service
        self._answer_time = answer_time
        self._clients = [self._new_client()]
        self._pending: Future | None = None
        self._factor = 1.0

    def start(self, request: Any, on_answer: OnAnswer = lambda _: None) -> Self:
        """Send this request from now on, in place of an earlier one; return the call."""
        self._request = request
        self._on_answer = on_answer
        self.answer: Any = None
        """The answer; None until it arrives."""
        self._pending = None
        self._attempt_ends: float | None = None
        return self

    @property
    def exists(self) -> bool:
        """Whether the service has appeared."""
        return self._node.count_services(self._service) > 0

    @property
    def sent(self) -> bool:
        """Whether the request was sent."""
        return self._pending is not None

    def pursue(self) -> bool:
        """Do the next step; call this repeatedly. Return whether the answer has arrived."""
        if self.answer is not None:
            return True
        if not self.exists:
            return False
        now = time.monotonic()
        if self._attempt_ends is not None and now > self._attempt_ends:
            self._clients.append(self._new_client())
            self._pending = self._attempt_ends = None
            self._factor *= 2.0
        if self._attempt_ends is None:
            self._attempt_ends = now + ANSWER_TIME * self._factor
        if self._pending is None and self._clients[-1].service_is_ready():
            self._attempt_ends = now + self._answer_time * self._factor
            self._pending = self._clients[-1].call_async(self._request)
            self._pending.add_done_callback(self._take)
        return False

    def wait(self, spinner: Spinner, timeout: float) -> Any:
        """Return the answer to the request that was started, while the spinner runs its nodes.

        Return None if the service does not appear, or does not answer, within `timeout` (s) each.
        """
        if spinner.spin_until(lambda: self.pursue() or self.sent, timeout):
            spinner.spin_until(self.pursue, timeout)
        return self.answer

    def close(self) -> None:
        """Stop; ignore an answer that still arrives."""
        self._pending = None
        for client in self._clients:
            self._node.destroy_client(client)

    def _new_client(self) -> Client:
        return self._node.create_client(self._kind, self._service)

    def _take(self, pending: Future) -> None:
        response = pending.result()
        if response is not None and pending is self._pending:
            self.answer = response
            self._factor = 1.0
            self._on_answer(response)


def parameters_call(
    node: Node, other: str, names: Sequence[str], on_answer: Callable[[dict[str, Any]], None]
) -> ServiceCall:
    """Return a call that requests the named parameters of the node `other`."""

    def take(response: Any) -> None:
        values: list[Any] = []
        with suppress(RuntimeError):  # a type that ROS does not know
            values += map(parameter_value_to_python, response.values)
        on_answer(dict(zip(names, values, strict=False)))

    call = ServiceCall(node, GetParameters, f"{other}/get_parameters")
    return call.start(GetParameters.Request(names=names), take)


class ParameterCalls:
    """Asks nodes of this package, by name relative to the namespace, for their parameters."""

    def __init__(self, node: Node, take: Callable[[str, dict[str, Any]], None]) -> None:
        """Ask through `node`; `take` receives the name of each node that answers, and the values.

        Those are by flat name.
        """
        self._node, self._take = node, take
        self._calls: dict[str, ServiceCall] = {}

    def __contains__(self, other: str) -> bool:
        return other in self._calls

    def ask(self, other: str) -> None:
        """Ask a node, in place of an earlier request."""
        if other in self._calls:
            self._calls[other].close()
        names, take = list(NODE_PARAMETERS[other].known), partial(self._take, other)
        self._calls[other] = parameters_call(self._node, other, names, take)

    def ask_again(self) -> None:
        """Ask all nodes again that were asked before."""
        for other in self._calls:
            self.ask(other)

    def pursue(self) -> bool:
        """Do the next step; return whether all the nodes that exist have answered."""
        answered = [call.pursue() or not call.exists for call in self._calls.values()]
        return all(answered)

    def has_answered(self, other: str) -> bool:
        """Return whether a node has answered the last request."""
        return other in self._calls and self._calls[other].answer is not None

    def close(self) -> None:
        """Stop; ignore answers that still arrive."""
        for call in self._calls.values():
            call.close()


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
        self._undecided: int | None = None
        """Transition that was requested and of which it is not known whether it was made."""
        self._patience_ends = inf

    def state(self) -> str:
        """Return the name of the node's state, empty if it does not answer."""
        answer = self._get_state.start(GetState.Request()).wait(self._spinner, self._timeout)
        return answer.current_state.label if answer is not None else ""

    def change_state(self, transition: int) -> bool:
        """Request a transition; return whether the node has made it.

        A request that is not answered in time may still have its effect, and then a second one is
        invalid: further calls look for its answer or its effect, and repeat it only after 15 s.
        """
        change = self._change_state
        if (
            transition != self._undecided
            or not change.sent
            or time.monotonic() > self._patience_ends
        ):
            self.start_change(transition)
            change.wait(self._spinner, self._timeout)
        # The answer may be lost, or arrive while the state is asked for.
        made = change.answer is None and self.state() == _STATE_AFTER[transition]
        if change.answer is not None:
            made = change.answer.success
        elif not made:
            self._patience_ends = min(self._patience_ends, time.monotonic() + _PATIENCE)
            return False
        self._undecided = None
        return made

    def start_change(self, transition: int) -> None:
        """Request a transition and do not wait for the answer: see `change_ended`."""
        self._undecided, self._patience_ends = transition, inf
        self._change_state.start(transition_request(transition))

    def change_ended(self) -> bool:
        """Send the request if that is due; return whether it was answered."""
        return self._change_state.pursue()

    def bring_up(self, timeout: float, check: Callable[[], None]) -> None:
        """Configure and activate the node unless it does so by itself.

        `check` is called repeatedly meanwhile; its exceptions propagate. Raises RunError if the
        node refuses, or is not active within `timeout` (s, wall time).
        """
        deadline = time.monotonic() + timeout
        asked: list[str] = []
        while (state := self.state()) != ACTIVE:
            check()
            refused = state in asked and self._undecided is None
            if refused or state == "finalized":
                done = _PARTICIPLE[asked[-1]] if asked else "brought up"
                raise RunError(f"the controller {self.name} could not be {done}; see its log")
            if time.monotonic() >= deadline:
                raise RunError(f"the controller {self.name} was not active within {timeout:g} s")
            # It may proceed to its next state by itself.
            if state in NEXT_TRANSITION and not self._spinner.spin_until(
                lambda before=state: self.state() != before, timeout=1.0
            ):
                asked.append(state)
                self.change_state(NEXT_TRANSITION[state])


def transition_request(transition: int) -> ChangeState.Request:
    """Return the request of a transition of a managed node."""
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
    with ros_session() as spinner:
        node = Node(
            "parameter_client",
            namespace=namespace,
            enable_rosout=False,
            start_parameter_services=False,
        )
        spinner.add(node)
        calls = {name: setting_call(node, name, new) for name, new in values.items()}
        for name, call in calls.items():
            if not spinner.spin_until(lambda call=call: call.exists, _DISCOVERY_TIME):
                raise NodeNotFoundError(_not_found(node, name))
        for name, call in calls.items():
            if call.wait(spinner, _ANSWER_TIME) is None:
                raise RunError(f"the node {full_name(node.get_namespace(), name)} does not answer")
        return {name: call.answer.result for name, call in calls.items()}


def _not_found(node: Node, name: str) -> str:
    elsewhere = sorted(
        full_name(namespace, running)
        for running, namespace in node.get_node_names_and_namespaces()
        if running == name
    )
    what = f"no node {full_name(node.get_namespace(), name)} is running"
    return f"{what}; running: {', '.join(elsewhere)}" if elsewhere else what


def setting_call(
    node: Node, other: str, values: Mapping[str, Any], on_answer: OnAnswer = lambda _: None
) -> ServiceCall:
    """Return a call that sets parameters of the node `other`, all of them or none."""
    call = ServiceCall(node, SetParametersAtomically, f"{other}/set_parameters_atomically")
    given = [_parameter(name, value).to_parameter_msg() for name, value in values.items()]
    return call.start(SetParametersAtomically.Request(parameters=given), on_answer)


def _parameter(name: str, value: Any) -> Parameter:
    if isinstance(value, list):  # of an empty one ROS cannot know the type
        return Parameter(name, Parameter.Type.STRING_ARRAY, value)
    return Parameter(name, value=value)
