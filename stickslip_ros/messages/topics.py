"""The topics: name, type, depth of history and meaning, each once.

Names are relative to the namespace.
"""

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.duration import Infinite
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
    meaning: str = ""

    def qos(self, depth: int | None = None) -> QoSProfile:
        """Return its quality of service, the history `depth` messages deep."""
        return QoSProfile(
            reliability=ReliabilityPolicy.RELIABLE,
            history=HistoryPolicy.KEEP_LAST,
            depth=self.depth if depth is None else depth,
        )


JOINT_STATES = Topic(
    "joint_states",
    JointState,
    "sensor_msgs/msg/JointState",
    DEEP,
    meaning="State at each sample: `name` slide and belt, `position` m, `velocity` m/s, `effort` N "
    "(friction on the slide, its reaction on the belt, under the force held up to then).",
)
CONTROL_FORCE = Topic(
    "control_force",
    WrenchStamped,
    "geometry_msgs/msg/WrenchStamped",
    DEEP,
    meaning="Force on the slide, `wrench.force.x` N, with the stamp of the state that it answers.",
)
DISTURBANCE_FORCE = Topic(
    "disturbance_force",
    WrenchStamped,
    "geometry_msgs/msg/WrenchStamped",
    meaning="A force of yours on the slide, `wrench.force.x` N, from the next sample on until the "
    "next message; its stamp does not matter.",
)
APPLIED_DISTURBANCE = Topic(
    "applied_disturbance",
    WrenchStamped,
    "geometry_msgs/msg/WrenchStamped",
    DEEP,
    meaning="All the disturbance that acts, `wrench.force.x` N, at each change, with the stamp of "
    "the sample from which it acts.",
)
DROPPED_FORCE = Topic(
    "dropped_force",
    WrenchStamped,
    "geometry_msgs/msg/WrenchStamped",
    DEEP,
    meaning="Each `control_force` that did not act, as it was sent: refused, overtaken by a newer "
    "one, or come while the plant was not active.",
)
RECORDED = Topic(
    "recorded",
    Header,
    "std_msgs/msg/Header",
    100,
    meaning="Stamp of the newest sample that the analyzer has taken in.",
)
AMPLITUDE = Topic(
    "limit_cycle/amplitude",
    Float64,
    "std_msgs/msg/Float64",
    meaning="Half the peak-to-peak displacement of each cycle, m; none while the slide rests.",
)
STICK_FRACTION = Topic(
    "limit_cycle/stick_fraction",
    Float64,
    "std_msgs/msg/Float64",
    meaning="Share of that cycle during which the slide stuck.",
)
FREQUENCY = Topic(
    "limit_cycle/frequency",
    Float64,
    "std_msgs/msg/Float64",
    meaning="One over the period of that cycle, Hz.",
)
DIAGNOSTICS = Topic(
    "/diagnostics",
    DiagnosticArray,
    "diagnostic_msgs/msg/DiagnosticArray",
    100,
    meaning="Health of the node, once a second of wall time, and when it is deactivated.",
)
CLOCK = Topic(
    "/clock",
    Clock,
    "rosgraph_msgs/msg/Clock",
    meaning="Simulated time, of a plant with `publish_clock`; recorded time, of a replay with "
    "`clock`.",
)

TOPICS = (
    JOINT_STATES,
    CONTROL_FORCE,
    DISTURBANCE_FORCE,
    APPLIED_DISTURBANCE,
    DROPPED_FORCE,
    AMPLITUDE,
    STICK_FRACTION,
    FREQUENCY,
    RECORDED,
    DIAGNOSTICS,
    CLOCK,
)
RECORDED_TOPICS = (JOINT_STATES, CONTROL_FORCE, APPLIED_DISTURBANCE, DROPPED_FORCE)
"""What the analyzer writes to its bag."""


def type_name(message_type: Any) -> str:
    """Return the name of a message class, such as `sensor_msgs/msg/JointState`."""
    return f"{message_type.__module__.partition('.')[0]}/msg/{message_type.__name__}"


def mismatch(writer: QoSProfile, reader: QoSProfile) -> str:
    """Return why a reader cannot hear a writer, or nothing."""
    compatibility, reason = qos_check_compatible(_explicit(writer), _explicit(reader))
    return reason if compatibility == QoSCompatibility.ERROR else ""


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
