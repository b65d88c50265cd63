"""Message class and quality of service of a topic, as rclpy takes them."""

from functools import cache
from importlib import import_module
from typing import Any

from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from stickslip_ros.messages.topics import Topic


def qos_profile(topic: Topic[Any], depth: int | None = None) -> QoSProfile:
    """Return the quality of service of a topic, the history `depth` messages deep."""
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        history=HistoryPolicy.KEEP_LAST,
        depth=topic.depth if depth is None else depth,
    )


@cache
def message_class(type_name: str) -> Any:
    """Return the class of a message type such as `sensor_msgs/msg/JointState`.

    Raises ImportError or AttributeError for a type that is not installed.
    """
    package, _, name = type_name.partition("/msg/")
    return getattr(import_module(f"{package}.msg"), name)
