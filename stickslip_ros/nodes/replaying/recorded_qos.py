"""Message class and quality of service with which a recorded topic is published again."""

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
    message_definition(type_name)  # what has no definition must not be imported
    try:
        return message_class(type_name)
    except (ImportError, AttributeError) as error:
        raise BagError(
            f"the message type '{type_name}' is not installed for Python: {error}"
        ) from error


def recorded_profile(recorded: str) -> QoSProfile:
    """Return the quality of service with which a topic was published, from the YAML of rosbag2.

    Writer and reader need not agree on the history. It is deep, except for a latched topic: a late
    reader gets as many messages as the recorded history held. The topic is reliable if nothing was
    recorded, or its publishers differed.
    """
    try:
        profiles = [_profile(values) for values in offered_profiles(recorded)]
    except Exception:  # the file may contain anything
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
    """Return the policy of this name or number; the default if it cannot be offered."""
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
