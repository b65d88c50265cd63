"""The messages that the analyzer takes in, each with a stamp in the time of the run."""

from collections.abc import Sequence
from itertools import islice
from typing import Any, NamedTuple

from rclpy.qos import ReliabilityPolicy
from rclpy.subscription import Subscription

from stickslip_ros.errors import MessageError
from stickslip_ros.nodes.base.endpoints import qos_profile, timed_messages
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.record import topics
from stickslip_ros.record.codec import UNSTAMPED, unpack_header
from stickslip_ros.stamps import END_OF_TIME, NANOSECONDS

_REFERENCE_AGE = 60 * NANOSECONDS
"""Time, ns, by which the stamp of a reference of the run may differ from that of the newest sample.
"""


class Message(NamedTuple):
    """A received message."""

    topic: topics.Topic[Any]
    stamp: int
    data: bytes


def recorded_topics(force_type: str) -> list[topics.Topic[Any]]:
    """Return the topics to record, for control forces of that type, or by `effort`."""
    kind = topics.CONTROL_FORCE.type_name if force_type == "effort" else force_type
    force, _ = topics.force_topics(kind)
    return [force if topic == topics.CONTROL_FORCE else topic for topic in topics.RECORDED_TOPICS]


class Incoming:
    """Subscriptions whose messages are taken in batches, as they wait."""

    def __init__(self, node: ManagedNode[Any], recorded: Sequence[topics.Topic[Any]]) -> None:
        """Subscribe to the recorded topics through a node."""
        self.newest = 0
        """Stamp of the newest sample, ns; 0 before the first."""
        self.behind = False
        """Whether more messages may have waited than the last batch could take."""
        self.published: list[topics.Topic[Any]] = []
        """Those topics of `RECORDED_IF_PUBLISHED` that have or had a publisher."""
        self._node, self._topics = node, recorded
        # Joint states last, see `missing_peers`.
        self._subscriptions = {topic: self._subscribe(topic) for topic in reversed(recorded)}

    def close(self) -> None:
        """Listen no more."""
        for subscription in self._subscriptions.values():
            self._node.release(subscription)

    def take_all(self) -> dict[topics.Topic[Any], list[Message]]:
        """Take a batch of all topics, joint states first."""
        taken = {topic: self.take(topic) for topic in self._topics}
        self.behind = any(len(messages) >= topics.DEEP for messages in taken.values())
        self.published += [
            topic
            for topic in topics.RECORDED_IF_PUBLISHED
            if topic not in self.published
            and (taken[topic] or self._subscriptions[topic].get_publisher_count() > 0)
        ]
        return taken

    def take(self, topic: topics.Topic[Any]) -> list[Message]:
        """Take the waiting messages of a topic; drop those without a valid stamp."""
        stamped = topic.type_name not in UNSTAMPED
        foreign_force = topic.name == topics.CONTROL_FORCE.name and topic != topics.CONTROL_FORCE
        taken: list[Message] = []
        # A publisher that sends faster than this must not block all other work.
        for data, sent in islice(timed_messages(self._subscriptions[topic]), topics.DEEP):
            try:
                stamp = unpack_header(data) if stamped else 0
            except MessageError as error:
                self._node.dropped.add(f"{topic.name}: {error}")
                continue
            if topic is topics.REFERENCE:
                stamp = self._within_run(stamp)
            elif stamp == 0 and foreign_force:
                simulated = self.newest and abs(sent - self.newest) > NANOSECONDS
                stamp = self.newest if simulated else sent
            elif not 0 < stamp < END_OF_TIME:
                self._node.dropped.add(f"{topic.name}: a message with the stamp {stamp} ns")
                continue
            taken.append(Message(topic, stamp, data))
        if topic is topics.JOINT_STATES and taken:
            self.newest = taken[-1].stamp
        return taken

    def match_publishers(self) -> None:
        """Hear best-effort publishers of other machines, too, which no reliable reader matches."""
        for topic, subscription in self._subscriptions.items():
            if topic.name not in (topics.JOINT_STATES.name, topics.CONTROL_FORCE.name):
                continue
            best_effort = any(
                publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
                for publisher in self._node.get_publishers_info_by_topic(subscription.topic_name)
            )
            if best_effort and subscription.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
                self._node.release(subscription)
                self._subscriptions[topic] = self._subscribe(topic, ReliabilityPolicy.BEST_EFFORT)

    def _subscribe(
        self, topic: topics.Topic[Any], reliability: ReliabilityPolicy | None = None
    ) -> Subscription:
        qos = qos_profile(topic, topics.RECORDER_DEPTH, reliability)
        return self._node.keep(self._node.create_polled_subscription(topic, qos))

    def _within_run(self, stamp: int) -> int:
        """Return the stamp of a reference, whose publisher may have any clock, or none.

        One that is not of the run is replaced by that of the newest sample.
        """
        newest = max(self.newest, 1)
        return stamp if stamp > 0 and abs(stamp - newest) <= _REFERENCE_AGE else newest
