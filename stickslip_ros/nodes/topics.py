"""The topics: name, type and depth of history, each once. Names are relative to the namespace."""

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import (
    HistoryPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Header

DEEP = 4_900
"""Messages that wait for a reader that falls behind; above 5,000, Fast DDS delays the writer."""


@dataclass(frozen=True)
class Topic:
    """A topic that nodes of this package write or read; reliable, with bounded history."""

    name: str
    type: Any
    type_name: str
    depth: int = 10

    def qos(self, depth: int | None = None) -> QoSProfile:
        """Return its quality of service, the history `depth` messages deep."""
        return QoSProfile(
            reliability=ReliabilityPolicy.RELIABLE,
            history=HistoryPolicy.KEEP_LAST,
            depth=self.depth if depth is None else depth,
        )


JOINT_STATES = Topic("joint_states", JointState, "sensor_msgs/msg/JointState", DEEP)
CONTROL_FORCE = Topic("control_force", WrenchStamped, "geometry_msgs/msg/WrenchStamped", DEEP)
DISTURBANCE_FORCE = Topic("disturbance_force", WrenchStamped, "geometry_msgs/msg/WrenchStamped")
APPLIED_DISTURBANCE = Topic(
    "applied_disturbance", WrenchStamped, "geometry_msgs/msg/WrenchStamped", DEEP
)
RECORDED = Topic("recorded", Header, "std_msgs/msg/Header", 100)
AMPLITUDE = Topic("limit_cycle/amplitude", Float64, "std_msgs/msg/Float64")
STICK_FRACTION = Topic("limit_cycle/stick_fraction", Float64, "std_msgs/msg/Float64")
FREQUENCY = Topic("limit_cycle/frequency", Float64, "std_msgs/msg/Float64")
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, "diagnostic_msgs/msg/DiagnosticArray", 100)
CLOCK = Topic("/clock", Clock, "rosgraph_msgs/msg/Clock", 10)

RECORDED_TOPICS = (JOINT_STATES, CONTROL_FORCE, APPLIED_DISTURBANCE)
"""What the analyzer writes to its bag."""


def mismatch(writer: QoSProfile, reader: QoSProfile) -> str:
    """Return why a reader cannot hear a writer, or nothing, by reliability and durability.

    What the graph tells of the other policies does not compare with what a node has asked for.
    """
    both = [
        QoSProfile(depth=1, reliability=profile.reliability, durability=profile.durability)
        for profile in (writer, reader)
    ]
    compatibility, reason = qos_check_compatible(*both)
    return reason if compatibility == QoSCompatibility.ERROR else ""
