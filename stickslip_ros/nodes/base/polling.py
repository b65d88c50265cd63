"""Subscriptions whose messages wait until the node takes them."""

from collections.abc import Iterator

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from stickslip_ros.messages.topics import Topic


class Collecting(Node):
    """A node that lets messages wait: no thread is woken for each of them."""

    def collect_from(self, topic: Topic, qos: QoSProfile) -> Subscription:
        """Let the serialized messages of a topic wait for `take_waiting`."""
        return self.create_subscription(topic.type, topic.name, _left_waiting, qos, raw=True)

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """The subscriptions whose messages an executor is to pass on as they come."""
        return (s for s in super().subscriptions if s.callback is not _left_waiting)


def take_waiting(subscription: Subscription) -> Iterator[bytes]:
    """Yield the serialized messages that wait for being taken, in order."""
    with subscription.handle:
        while taken := subscription.handle.take_message(subscription.msg_type, True):
            yield taken[0]


def _left_waiting(_: bytes) -> None:
    """Stand for a callback where there is none."""
