"""Nodes of a test, composed in this process."""

import time
from collections.abc import Callable
from itertools import count
from threading import Event
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from stickslip_ros.nodes.base.endpoints import message_class, qos_profile
from stickslip_ros.nodes.base.managed import STATE, ManagedNode
from stickslip_ros.nodes.base.spinner import Spinner
from stickslip_ros.record.codec import pack_wrench, unpack_header
from stickslip_ros.record.topics import CONTROL_FORCE, DIAGNOSTICS, JOINT_STATES

PATIENCE = 120.0
"""How long a test waits, s, for what should happen at once on an idle machine."""

_ATTEMPTS = 12
"""To get an answer from a service within that time."""


def wait_for(condition: Callable[[], object], what: str, patience: float = PATIENCE) -> None:
    """Wait until the condition, which other processes bring about, holds; fail if it never does."""
    nothing = Event()
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, f"waited {patience} s in vain: {what}"
        nothing.wait(0.02)


def states_of(health: list[DiagnosticStatus]) -> list[str]:
    """Return in which states of its life cycle a node has said to be, the newest last."""
    return [entry.value for status in health for entry in status.values if entry.key == STATE]


class Graph:
    """Nodes on one executor, run only while the test waits for something."""

    def __init__(self, domain: int, *ros_arguments: str) -> None:
        self.context = Context()
        rclpy.init(
            args=["--ros-args", *ros_arguments],
            context=self.context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.spinner = Spinner(self.context)
        self.executor = self.spinner.executor
        self._nodes: list[Any] = []
        self.observer = Node("observer", context=self.context, namespace="/test")
        self.adopt(self.observer)

    def add(self, node: type[ManagedNode[Any]], **parameters: Any) -> Any:
        """Add one of our nodes in the namespace /test."""
        made = node(context=self.context, namespace="/test", overrides=parameters)
        self.adopt(made)
        return made

    def add_active(self, node: type[ManagedNode[Any]], **parameters: Any) -> Any:
        """Add one of our nodes and wait until it is active."""
        made = self.add(node, **parameters)
        self.wait_until(lambda: made.active, f"{made.get_name()} is active")
        return made

    def adopt(self, node: Node) -> None:
        """Add a node that exists already."""
        self._nodes.append(node)
        self.spinner.add(node)

    def wait_until(self, condition: Callable[[], object], what: str) -> None:
        """Run the nodes until the condition holds; fail with `what` if it does not in time."""
        holds = self.spinner.spin_until(lambda: bool(condition()), PATIENCE)
        assert holds, f"waited {PATIENCE} s in vain: {what}"

    def run_for(self, seconds: float) -> None:
        """Run the nodes for so long, of wall time."""
        self.spinner.spin_for(seconds)

    def call(
        self, kind: Any, name: str, request: Any, enough: Callable[[], object] = lambda: False
    ) -> Any:
        """Call a service and return its answer, None if it is `enough` that a condition holds.

        On a busy machine the middleware may lose an answer, or never find the service for a client:
        then another one asks again.
        """
        for _ in range(_ATTEMPTS):
            client = self.observer.create_client(kind, name)
            self.spinner.spin_until(client.service_is_ready, PATIENCE / _ATTEMPTS)
            answer = client.call_async(request)
            self.spinner.spin_until(
                lambda a=answer: bool(a.done() or enough()), PATIENCE / _ATTEMPTS
            )
            self.observer.destroy_client(client)
            if answer.done() or enough():
                return answer.result()
        raise AssertionError(f"waited {PATIENCE} s in vain: answer of {name}")

    def deactivate(self, name: str) -> None:
        """Deactivate one of our nodes as others do, behind the messages it has to take already."""
        request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE))
        node = next(node for node in self._nodes if node.get_name() == name)
        self.call(ChangeState, f"/test/{name}/change_state", request, lambda: not node.active)
        assert not node.active

    def listen(self, topic: Any, raw: bool = False) -> list[Any]:
        """Return a list to which every message of a topic will be appended."""
        heard: list[Any] = []
        self.subscribe(topic, heard.append, raw=raw)
        return heard

    def health(self, node: str) -> list[DiagnosticStatus]:
        """Return a list that gets every status of a node: of one in /test, or of a full name."""
        name = node if node.startswith("/") else f"/test/{node}"
        heard: list[DiagnosticStatus] = []

        def take(array: Any) -> None:
            heard.extend(status for status in array.status if status.name == name)

        self.subscribe(DIAGNOSTICS, take, raw=False)
        return heard

    def subscribe(
        self, topic: Any, callback: Callable[[Any], None], raw: bool = True
    ) -> Subscription:
        """Let the observer take every message of a topic, serialized if `raw`."""
        kind, qos = message_class(topic.type_name), qos_profile(topic, 10_000)
        return self.observer.create_subscription(kind, topic.name, callback, qos, raw=raw)

    def publisher(self, topic: Any, readers: int = 0) -> Publisher:
        """Return a publisher of the observer that is matched with so many readers or more."""
        made = self.observer.create_publisher(
            message_class(topic.type_name), topic.name, qos_profile(topic)
        )
        self.wait_until(
            lambda: made.get_subscription_count() >= readers, f"readers of {topic.name}"
        )
        return made

    def answer_every_third_sample(self) -> None:
        """Let the observer be a controller that is late two times of three."""
        force, counted = self.publisher(CONTROL_FORCE), count()

        def answer(message: bytes) -> None:
            if next(counted) % 3 == 0:
                force.publish(pack_wrench(unpack_header(message), 0.0))

        self.subscribe(JOINT_STATES, answer)

    def close(self) -> None:
        """Take everything down."""
        self.spinner.close()
        rclpy.shutdown(context=self.context)
