"""Asking other nodes, while the middleware responds late: services, states, parameters."""

from collections.abc import Iterator
from typing import Any

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.client import Client
from rclpy.node import Node
from std_srvs.srv import Trigger

from stickslip_ros.nodes.base.clients import LifecycleClient, ServiceCall, parameters_call
from stickslip_ros.nodes.base.process import loopback_session
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from tests.nodes.graph import PATIENCE, Graph, wait_for

CONFIGURE = Transition.TRANSITION_CONFIGURE
ACTIVATE = Transition.TRANSITION_ACTIVATE


@pytest.fixture
def client(domain: int) -> Iterator[LifecycleClient]:
    with loopback_session(domain, ["--ros-args"]) as spinner:
        context = spinner.executor.context
        asking = Node("asking", context=context)
        spinner.add(asking)
        spinner.add(WashoutControllerNode(context=context, overrides={"autostart": False}))
        yield LifecycleClient(spinner, asking, "washout_controller", PATIENCE)


def test_the_state_replaces_an_answer_that_is_lost(
    client: LifecycleClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    take = ServiceCall._take
    lost: list[Any] = []

    def lose_the_first(call: ServiceCall, pending: Any) -> None:
        if call is client._change_state and not lost:
            lost.append(pending.result())
        else:
            take(call, pending)

    monkeypatch.setattr(ServiceCall, "_take", lose_the_first)
    monkeypatch.setattr(client, "_timeout", 0.5)
    wait_for(lambda: client.change_state(CONFIGURE), "it is configured")
    assert [answer.success for answer in lost] == [True]
    wait_for(lambda: client.change_state(ACTIVATE), "it is active")


class _Slow:
    """A managed node that tells its state at once and takes requests of transitions when told to.

    What is sent before then is on its way.
    """

    def __init__(self, graph: Graph) -> None:
        self.requests: list[int] = []
        self.state = "unconfigured"
        self._graph = graph
        self._prompt = Node("prompt", context=graph.context, namespace="/test")
        self._prompt.create_service(GetState, "slow/get_state", self._tell)
        self._late = Node("late", context=graph.context, namespace="/test")
        self._late.create_service(ChangeState, "slow/change_state", self._change)
        graph.adopt(self._prompt)

    def take_requests(self) -> None:
        self._graph.adopt(self._late)
        self._graph.wait_until(lambda: self.requests, "the first request")

    def _tell(self, _: GetState.Request, response: GetState.Response) -> GetState.Response:
        response.current_state.label = self.state
        return response

    def _change(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        self.requests.append(request.transition.id)
        response.success = True
        self.state = "inactive"
        return response


@pytest.fixture
def slow(graph: Graph) -> _Slow:
    return _Slow(graph)


def test_a_request_on_its_way_is_not_repeated_and_a_late_answer_counts(
    graph: Graph, slow: _Slow
) -> None:
    client = LifecycleClient(graph.spinner, graph.observer, "slow", 0.5)
    client.start_change(CONFIGURE)
    graph.wait_until(lambda: client.change_ended() or client._change_state.sent, "it is sent")
    assert not [True for _ in range(3) if client.change_state(CONFIGURE)]
    slow.take_requests()
    graph.wait_until(client.change_ended, "the answer")
    slow.state = "unconfigured"  # whoever asks for the state did so before
    assert client.change_state(CONFIGURE)
    assert slow.requests == [CONFIGURE]


def test_a_transition_that_is_still_without_effect_is_requested_again(
    graph: Graph, slow: _Slow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip_ros.nodes.base.clients._PATIENCE", 0.0)
    client = LifecycleClient(graph.spinner, graph.observer, "slow", 0.5)
    assert not client.change_state(CONFIGURE)
    assert not client.change_state(CONFIGURE)
    slow.take_requests()
    graph.wait_until(lambda: len(slow.requests) == 2, "both requests")
    assert client.change_state(CONFIGURE)


def answer_once(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    response.message = "here"
    return response


def test_a_service_is_asked_again_and_again_by_one_call(domain: int) -> None:
    with loopback_session(domain, ["--ros-args"]) as spinner:
        node = Node("asking", context=spinner.executor.context)
        spinner.add(node)
        call = ServiceCall(node, Trigger, "ring")
        assert call.start(Trigger.Request()).wait(spinner, 0.1) is None
        assert not call.sent
        service = node.create_service(Trigger, "ring", answer_once)
        answers: list[Any] = [call.start(Trigger.Request()).wait(spinner, 10.0) for _ in range(2)]
        assert [answer.message for answer in answers] == ["here", "here"]
        assert answers[0] is not answers[1]
        node.destroy_service(service)
        assert call.start(Trigger.Request()).wait(spinner, 0.2) is None


class _Unlucky(Node):
    """A node whose first client never matches, although the service is there."""

    def __init__(self, graph: Graph) -> None:
        super().__init__("unlucky", context=graph.context, namespace="/test")
        self.clients_made = 0

    def create_client(self, srv_type: Any, srv_name: str, **options: Any) -> Client:
        self.clients_made += 1
        name = srv_name if self.clients_made > 1 else "nowhere/to_be_found"
        return super().create_client(srv_type, name, **options)


@pytest.fixture
def unlucky(graph: Graph) -> _Unlucky:
    node = _Unlucky(graph)
    graph.adopt(node)
    return node


@pytest.mark.parametrize(
    ("names", "known"),
    [(["mass", "rate"], {"mass": 3.0, "rate": 10.0}), (["no_such_parameter"], {})],
)
def test_another_client_asks_where_one_does_not_match(
    graph: Graph, unlucky: _Unlucky, names: list[str], known: dict[str, Any]
) -> None:
    graph.add(PlantNode, autostart=False, mass=3.0, rate=10.0)
    answers: list[dict[str, Any]] = []
    call = parameters_call(unlucky, "plant", names, answers.append)
    graph.wait_until(lambda: call.pursue() or answers, "the plant answers")
    assert answers == [known]
    assert unlucky.clients_made > 1
    call.close()


def test_for_a_node_that_is_not_there_one_client_is_enough(graph: Graph, unlucky: _Unlucky) -> None:
    call = parameters_call(unlucky, "plant", ["mass"], lambda _: None)
    rounds = iter(range(30))
    graph.wait_until(lambda: call.pursue() or next(rounds, None) is None, "many rounds")
    assert unlucky.clients_made == 1
    call.close()


def test_a_service_that_runs_late_still_finds_the_clients_that_asked_before(
    graph: Graph, unlucky: _Unlucky, recwarn: pytest.WarningsRecorder
) -> None:
    asked: list[None] = []

    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        asked.append(None)
        return response

    late = Node("late", context=graph.context, namespace="/test")
    late.create_service(Trigger, "late", answer)
    call = ServiceCall(unlucky, Trigger, "late", answer_time=0.05)
    call.start(Trigger.Request())
    graph.wait_until(lambda: call.pursue() or unlucky.clients_made == 4, "it repeats")
    graph.adopt(late)
    graph.wait_until(lambda: call.pursue() and len(asked) >= 2, "each request is answered")
    call.close()
    assert not [each for each in recwarn if "failed to send response" in str(each.message)]
    assert not list(unlucky.clients)
