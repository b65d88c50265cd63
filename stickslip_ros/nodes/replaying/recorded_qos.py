"""How a recorded topic is published again: its message class and its quality of service."""

from collections.abc import Mapping
from typing import Any, TypeVar

from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSPolicyEnum,
    QoSProfile,
    ReliabilityPolicy,
)

from stickslip_ros.bags.definitions import message_definition
from stickslip_ros.bags.metadata import offered_profiles
from stickslip_ros.errors import BagError
from stickslip_ros.messages.topics import DEEP
from stickslip_ros.nodes.base.ros_topics import message_class
from stickslip_ros.stamps import NANOSECONDS

PolicyT = TypeVar("PolicyT", bound=QoSPolicyEnum)


def installed_message_class(type_name: str) -> Any:
    """Return the class of a message type such as `sensor_msgs/msg/JointState`.

    Raises BagError for a type that is not installed.
    """
    message_definition(type_name)  # what has none is no message, and must not be imported
    try:
        return message_class(type_name)
    except (ImportError, AttributeError) as error:
        raise BagError(
            f"the message type '{type_name}' is not installed for Python: {error}"
        ) from error


def recorded_profile(recorded: str) -> QoSProfile:
    """Return the quality of service with which a topic was offered, from YAML as rosbag2 keeps it.

    History is no matter between writer and reader: it is deep, but for a topic that latches, of
    which a late reader gets as many messages as were kept. Where nothing is recorded, or publishers
    differed, the topic is reliable.
    """
    try:
        profiles = [_profile(values) for values in offered_profiles(recorded)]
    except Exception:  # there is no end to what may stand in a file of others
        profiles = []
    if profiles and all(profile == profiles[0] for profile in profiles):
        return profiles[0]
    return _profile({})


def _profile(values: Mapping[str, Any]) -> QoSProfile:
    durability = _policy(DurabilityPolicy.VOLATILE, values.get("durability"))
    latches = durability is DurabilityPolicy.TRANSIENT_LOCAL
    depth = int(values.get("depth", 0))
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=min(max(depth, 1 if latches else DEEP), 100_000),
        reliability=_policy(ReliabilityPolicy.RELIABLE, values.get("reliability")),
        durability=durability,
        deadline=_duration(values.get("deadline")),
        lifespan=_duration(values.get("lifespan")),
        liveliness=_policy(LivelinessPolicy.AUTOMATIC, values.get("liveliness")),
        liveliness_lease_duration=_duration(values.get("liveliness_lease_duration")),
        avoid_ros_namespace_conventions=bool(values.get("avoid_ros_namespace_conventions")),
    )


def _policy(default: PolicyT, recorded: str | int | None) -> PolicyT:
    """Return the policy of that name or number; the default if it is none to offer."""
    kind = type(default)
    if recorded is None:
        return default
    number = kind.get_from_short_key(recorded) if isinstance(recorded, str) else recorded
    policy = kind(number)
    none_to_offer = ("SYSTEM_DEFAULT", "UNKNOWN", "BEST_AVAILABLE")
    return default if policy.name in none_to_offer else policy


def _duration(recorded: Mapping[str, int] | None) -> Duration:
    values = recorded or {}
    nanoseconds = int(values.get("sec", 0)) * NANOSECONDS + int(values.get("nsec", 0))
    return Duration(nanoseconds=min(nanoseconds, 2**63 - 1))
