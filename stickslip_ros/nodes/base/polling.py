"""Subscriptions whose messages wait in the queue until the node takes them."""

from collections.abc import Iterator
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from stickslip_ros.messages.topics import Topic
from stickslip_ros.nodes.base.ros_topics import message_class


class PollingNode(Node):
    """A node that polls for messages: no thread wakes for each of them."""

    def create_polled_subscription(self, topic: Topic[Any], qos: QoSProfile) -> Subscription:
        """Subscribe to a topic whose serialized messages wait for `waiting_messages`."""
        kind = message_class(topic.type_name)
        return self.create_subscription(kind, topic.name, _never_called, qos, raw=True)

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """The subscriptions that the executor serves: those that are not polled."""
        return (s for s in super().subscriptions if s.callback is not _never_called)


def waiting_messages(subscription: Subscription) -> Iterator[bytes]:
    """Take the waiting serialized messages and yield them in order."""
    with subscription.handle:
        while taken := subscription.handle.take_message(subscription.msg_type, True):
            yield taken[0]


def _never_called(_: bytes) -> None: ...
