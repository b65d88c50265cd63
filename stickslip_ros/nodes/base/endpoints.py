"""Endpoints in rclpy of the topics of `record.topics`, which has their quality of service."""

from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from typing import Any, TypeVar

from rclpy.duration import Duration, Infinite
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from stickslip_ros.record.topics import HISTORY, Topic

ThingT = TypeVar("ThingT")


def qos_profile(
    topic: Topic[Any], depth: int | None = None, reliability: ReliabilityPolicy | None = None
) -> QoSProfile:
    """Return the quality of service of a topic, or one with another depth or reliability."""
    return QoSProfile(
        history=HistoryPolicy.get_from_short_key(HISTORY),
        depth=topic.depth if depth is None else depth,
        reliability=reliability or ReliabilityPolicy.get_from_short_key(topic.reliability),
        durability=DurabilityPolicy.get_from_short_key(topic.durability),
    )


@cache
def message_class(type_name: str) -> Any:
    """Return the class of a message type such as `sensor_msgs/msg/JointState`.

    Raises ImportError or AttributeError for a type that is not installed.
    """
    package, _, name = type_name.partition("/msg/")
    return getattr(import_module(f"{package}.msg"), name)


def mismatch(writer: QoSProfile, reader: QoSProfile) -> str:
    """Return why a reader cannot receive from a writer, or an empty string."""
    compatibility, reason = qos_check_compatible(_explicit(writer), _explicit(reader))
    return reason if compatibility == QoSCompatibility.ERROR else ""


def matching_ends(node: Node, end: Publisher | Subscription) -> list[TopicEndpointInfo]:
    """Return the readers, or writers, in the graph that match a publisher, or subscription."""
    kind: Any = end.msg_type
    type_name = f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
    if isinstance(end, Publisher):
        others = node.get_subscriptions_info_by_topic(end.topic_name)
        pairs = [(end.qos_profile, other.qos_profile) for other in others]
    else:
        others = node.get_publishers_info_by_topic(end.topic_name)
        pairs = [(other.qos_profile, end.qos_profile) for other in others]
    return [
        other
        for other, (writer, reader) in zip(others, pairs, strict=True)
        if other.topic_type == type_name and not mismatch(writer, reader)
    ]


def _explicit(profile: QoSProfile) -> QoSProfile:
    """Return the profile as the graph reports it: unset durations are infinite."""

    def explicit(duration: Duration) -> Duration:
        return duration if duration.nanoseconds > 0 else Infinite

    return QoSProfile(
        depth=1,
        reliability=profile.reliability,
        durability=profile.durability,
        deadline=explicit(profile.deadline),
        liveliness_lease_duration=explicit(profile.liveliness_lease_duration),
    )


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


class KeepingNode(PollingNode):
    """A node that keeps publishers, subscriptions, services and timers until it is cleaned up."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        """Make the node; the arguments are those of the next base class."""
        super().__init__(*arguments, **options)
        self.kept: list[Any] = []
        """What it keeps, the oldest first."""

    def keep(self, thing: ThingT) -> ThingT:
        """Return a publisher, subscription, service or timer; cleaning up the node destroys it."""
        self.kept.append(thing)
        return thing

    def release(self, thing: Any) -> None:
        """Destroy an object of `keep` now."""
        self.kept.remove(thing)
        # The node must release it, too: an object that only destroys itself still gets messages.
        destroyers = self.destroy_publisher, self.destroy_subscription, self.destroy_service
        if not any(destroy(thing) for destroy in (*destroyers, self.destroy_timer)):
            thing.destroy()

    def advertise(self, topic: Topic[Any]) -> Publisher:
        """Create a publisher of a topic, which lasts until the node is cleaned up.

        It takes messages of the topic's type, or their serialized bytes.
        """
        kind = message_class(topic.type_name)
        return self.keep(self.create_publisher(kind, topic.name, qos_profile(topic)))

    def subscribe_serialized(
        self, topic: Topic[Any], callback: Callable[[bytes], None], depth: int | None = None
    ) -> Subscription:
        """Pass the serialized messages of a topic to `callback` until the node is cleaned up."""
        kind, qos = message_class(topic.type_name), qos_profile(topic, depth)
        return self.keep(self.create_subscription(kind, topic.name, callback, qos, raw=True))

    def release_all(self) -> None:
        """Destroy all objects of `keep`."""
        for thing in list(self.kept):
            self.release(thing)


def waiting_messages(subscription: Subscription) -> Iterator[bytes]:
    """Take the waiting serialized messages and yield them in order."""
    return (data for data, _ in timed_messages(subscription))


def timed_messages(subscription: Subscription) -> Iterator[tuple[bytes, int]]:
    """Take the waiting serialized messages and yield each, and when it was sent, ns."""
    with subscription.handle:
        while taken := subscription.handle.take_message(subscription.msg_type, True):
            yield taken[0], taken[1]["source_timestamp"]


def _never_called(_: bytes) -> None: ...
