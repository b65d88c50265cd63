"""Inherited by a user's node: decoded topics, dropped messages, clean-up."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from std_msgs.msg import Float64

from stickslip_ros.nodes.base.managed import OK, WARN, ManagedNode
from stickslip_ros.record.codec import pack_header
from stickslip_ros.record.topics import AMPLITUDE, DIAGNOSTICS, RECORDED
from stickslip_ros.scenarios.parameter_group import NodeParameters
from tests.nodes.graph import Graph


class Thing:
    destroyed = False

    def destroy(self) -> None:
        self.destroyed = True


class Listener(ManagedNode[NodeParameters]):
    def __init__(self, **options: Any) -> None:
        super().__init__("listener", NodeParameters(), **options)
        self.stamps: list[int] = []
        self.always: list[int] = []
        self.amplitudes: list[float] = []

    def connect(self) -> None:
        self.thing = self.keep(Thing())
        self.subscribe(RECORDED, self.stamps.append)
        self.subscribe(RECORDED, self.always.append, while_active=False)
        self.subscribe(AMPLITUDE, lambda message: self.amplitudes.append(message.data))


def test_messages_come_decoded_and_unless_asked_for_only_while_active(graph: Graph) -> None:
    """Those of a topic without a decoder are the objects of ROS."""
    node = graph.add(Listener, autostart=False)
    node.trigger_configure()
    publisher = graph.publisher(RECORDED, 2)
    publisher.publish(pack_header(1))
    graph.wait_until(lambda: node.always == [1], "one comes while inactive")
    node.trigger_activate()
    publisher.publish(pack_header(2))
    graph.wait_until(lambda: node.always == [1, 2], "another while active")
    assert node.stamps == [2]
    graph.publisher(AMPLITUDE, 1).publish(Float64(data=0.25))
    graph.wait_until(lambda: node.amplitudes == [0.25], "an object of ROS")


def test_what_cannot_be_decoded_is_told_until_the_next_activation(graph: Graph) -> None:
    told: list[DiagnosticArray] = graph.listen(DIAGNOSTICS)
    node = graph.add_active(Listener)
    publisher = graph.publisher(RECORDED, 2)
    publisher.publish(b"\0\1\0\0")
    graph.wait_until(lambda: node.diagnose()[0] == WARN, "dropped")
    node.publish_diagnostics()

    def dropped() -> list[str]:
        values = [{v.key: v.value for v in array.status[0].values} for array in told]
        return [figures.get("dropped_messages", "") for figures in values]

    graph.wait_until(lambda: "2" in dropped(), "told, once for each subscription")
    assert "recorded: a header message" in node.diagnose()[1]
    node.trigger_deactivate()
    assert node.diagnose() == (OK, "", {})
    node.trigger_activate()
    assert node.diagnose()[2] == {"dropped_messages": 0, "last_dropped": "none"}


def test_kept_resources_are_destroyed_at_clean_up(graph: Graph) -> None:
    node = graph.add(Listener, autostart=False)
    node.trigger_configure()
    assert not node.thing.destroyed
    node.trigger_cleanup()
    assert node.thing.destroyed
    assert not [s for s in node.subscriptions if s.topic_name.endswith(RECORDED.name)]


def test_an_invalid_transition_is_answered_and_so_are_the_requests_behind_it(graph: Graph) -> None:
    node = graph.add(Listener, autostart=False)
    client = graph.observer.create_client(ChangeState, "listener/change_state")
    graph.wait_until(client.service_is_ready, "the service is found")
    unknown = 99
    transitions = (
        Transition.TRANSITION_CONFIGURE,
        Transition.TRANSITION_CONFIGURE,
        unknown,
        Transition.TRANSITION_ACTIVATE,
    )
    requests = [ChangeState.Request(transition=Transition(id=number)) for number in transitions]
    answers = [client.call_async(request) for request in requests]
    graph.wait_until(lambda: all(answer.done() for answer in answers), "each is answered")
    assert [answer.result().success for answer in answers] == [True, False, False, True]
    assert node.active
