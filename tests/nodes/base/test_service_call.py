"""Requesting parameters of another node while the middleware responds late."""

from typing import Any

import pytest
from rclpy.client import Client
from rclpy.node import Node
from std_srvs.srv import Trigger

from stickslip_ros.nodes.base.service_call import ServiceCall, parameters_call
from stickslip_ros.nodes.plant import PlantNode
from tests.nodes.graph import Graph


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
