"""Which writers and readers in the ROS graph fit each other, by type and quality of service."""

from typing import Any

from rclpy.duration import Infinite
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo


def mismatch(writer: QoSProfile, reader: QoSProfile) -> str:
    """Return why a reader cannot hear a writer, or nothing."""
    compatibility, reason = qos_check_compatible(_explicit(writer), _explicit(reader))
    return reason if compatibility == QoSCompatibility.ERROR else ""


def matching_readers(node: Node, writer: Publisher) -> list[TopicEndpointInfo]:
    """Return those in the graph that can read what a node's publisher writes."""
    return [
        reader
        for reader in node.get_subscriptions_info_by_topic(writer.topic_name)
        if reader.topic_type == _type_name(writer.msg_type)
        and not mismatch(writer.qos_profile, reader.qos_profile)
    ]


def matching_writers(node: Node, reader: Subscription) -> list[TopicEndpointInfo]:
    """Return those in the graph that write what a node's subscription can read."""
    return [
        writer
        for writer in node.get_publishers_info_by_topic(reader.topic_name)
        if writer.topic_type == _type_name(reader.msg_type)
        and not mismatch(writer.qos_profile, reader.qos_profile)
    ]


def _type_name(message_class: Any) -> str:
    return f"{message_class.__module__.partition('.')[0]}/msg/{message_class.__name__}"


def _explicit(profile: QoSProfile) -> QoSProfile:
    """Return the profile as the graph tells it: there what is not set is infinite."""
    return QoSProfile(
        depth=1,
        reliability=profile.reliability,
        durability=profile.durability,
        deadline=profile.deadline if profile.deadline.nanoseconds > 0 else Infinite,
        liveliness_lease_duration=(
            profile.liveliness_lease_duration
            if profile.liveliness_lease_duration.nanoseconds > 0
            else Infinite
        ),
    )
