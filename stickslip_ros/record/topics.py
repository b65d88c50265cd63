"""The topics: name, type, quality of service, meaning and decoder of each; no ROS.

Names are relative to the namespace.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from stickslip_ros.record.codec import (
    unpack_header,
    unpack_joint_state,
    unpack_reference,
    unpack_wrench,
)

MessageT = TypeVar("MessageT")

DEEP = 4_900
"""Messages queued for a reader that falls behind; above 5,000, Fast DDS delays the writer."""
RECORDER_DEPTH = 20_000
"""Messages of a topic that wait in the analyzer; each takes about a kilobyte."""

HISTORY, RELIABLE, VOLATILE = "keep_last", "reliable", "volatile"
"""Quality of service, in rosbag2's names; the history of all topics is that."""

_WRENCH = "geometry_msgs/msg/WrenchStamped"
_NUMBER = "std_msgs/msg/Float64"


@dataclass(frozen=True)
class Topic(Generic[MessageT]):
    """A topic that the nodes of this package publish or subscribe."""

    name: str
    type_name: str
    depth: int = 10
    """Messages that wait for a slow reader."""
    meaning: str = ""
    decode: Callable[[bytes], MessageT] | None = None
    """Decodes a serialized message or raises BagError; None: ROS deserializes it to an object."""
    reliability: str = RELIABLE
    durability: str = VOLATILE


JOINT_STATES = Topic(
    "joint_states",
    "sensor_msgs/msg/JointState",
    DEEP,
    meaning="State at each sample, as the sensor tells it: `name` slide and belt, `position` m, "
    "`velocity` m/s, `effort` N (friction on the slide and its reaction on the belt, under the "
    "force held up to this sample); a motor of finite mass is the third joint, `motor`, with the "
    "force on it.",
    decode=unpack_joint_state,
)
TRUE_JOINT_STATES = Topic(
    "true_joint_states",
    "sensor_msgs/msg/JointState",
    DEEP,
    meaning="True state at each sample, from a plant with `publish_truth`.",
    decode=unpack_joint_state,
)
CONTROL_FORCE = Topic(
    "control_force",
    _WRENCH,
    DEEP,
    meaning="Control force on the slide, `wrench.force.x` N, with the stamp of the state that it "
    "answers.",
    decode=unpack_wrench,
)
JOINT_COMMANDS: Topic[Any] = Topic(
    "joint_commands",
    "sensor_msgs/msg/JointState",
    DEEP,
    meaning="Control force on the slide as ros2_control sends it: `effort` N of the joint `slide`, "
    "or the only one.",
)
REFERENCE = Topic(
    "reference",
    "sensor_msgs/msg/JointState",
    DEEP,
    meaning="Motion that the controller follows: joint `slide`, `position` m, `velocity` m/s; each "
    "may be empty. From another node it holds until the next message; a controller with a profile "
    "of its own publishes it with the stamp of each state that it answers.",
    decode=unpack_reference,
)
DISTURBANCE_FORCE = Topic(
    "disturbance_force",
    _WRENCH,
    meaning="External force on the slide, `wrench.force.x` N, from the next sample until the next "
    "message; the stamp is ignored.",
    decode=unpack_wrench,
)
APPLIED_FORCE = Topic(
    "applied_force",
    _WRENCH,
    DEEP,
    meaning="Force of the actuator on the slide, `wrench.force.x` N, at each sample, from a plant "
    "with `publish_truth`; `control_force` is the command.",
    decode=unpack_wrench,
)
APPLIED_DISTURBANCE = Topic(
    "applied_disturbance",
    _WRENCH,
    DEEP,
    meaning="Total disturbance force that acts, `wrench.force.x` N, published at each change, with "
    "the stamp of the first sample it acts on.",
    decode=unpack_wrench,
)
DROPPED_FORCE = Topic(
    "dropped_force",
    _WRENCH,
    DEEP,
    meaning="Each `control_force` that did not act, as sent: refused, replaced by a newer one, or "
    "received while the plant was not active.",
    decode=unpack_wrench,
)
RECORDED = Topic(
    "recorded",
    "std_msgs/msg/Header",
    100,
    meaning="Stamp of the newest sample that the analyzer has processed.",
    decode=unpack_header,
)
AMPLITUDE: Topic[Any] = Topic(
    "limit_cycle/amplitude",
    _NUMBER,
    meaning="Half the peak-to-peak displacement of each cycle, m; no message while the slide is "
    "at rest.",
)
STICK_FRACTION: Topic[Any] = Topic(
    "limit_cycle/stick_fraction",
    _NUMBER,
    meaning="Fraction of that cycle during which the slide stuck; NaN where noise hides it.",
)
FREQUENCY: Topic[Any] = Topic(
    "limit_cycle/frequency", _NUMBER, meaning="One over the period of that cycle, Hz."
)
DECAY_RATE: Topic[Any] = Topic(
    "stability/decay_rate",
    _NUMBER,
    meaning="Decay rate of the vibration after each tap or step of the feed, 1/s.",
)
ONSET_SPEED: Topic[Any] = Topic(
    "stability/onset_speed",
    _NUMBER,
    meaning="Belt speed at which vibration starts, m/s, by the decay rates so far.",
)
DIAGNOSTICS: Topic[Any] = Topic(
    "/diagnostics",
    "diagnostic_msgs/msg/DiagnosticArray",
    100,
    meaning="Health of the node, once per second of wall time and on deactivation.",
)
CLOCK: Topic[Any] = Topic(
    "/clock",
    "rosgraph_msgs/msg/Clock",
    meaning="Simulated time from a plant with `publish_clock`; recorded time from a replay with "
    "`clock`.",
)

TOPICS = (
    JOINT_STATES,
    TRUE_JOINT_STATES,
    CONTROL_FORCE,
    JOINT_COMMANDS,
    APPLIED_FORCE,
    DISTURBANCE_FORCE,
    APPLIED_DISTURBANCE,
    DROPPED_FORCE,
    REFERENCE,
    AMPLITUDE,
    STICK_FRACTION,
    FREQUENCY,
    DECAY_RATE,
    ONSET_SPEED,
    RECORDED,
    DIAGNOSTICS,
    CLOCK,
)
RECORDED_IF_PUBLISHED = (DROPPED_FORCE, REFERENCE, TRUE_JOINT_STATES, APPLIED_FORCE)
"""Topics that a bag has only if a node publishes them."""
RECORDED_TOPICS = (JOINT_STATES, CONTROL_FORCE, APPLIED_DISTURBANCE, *RECORDED_IF_PUBLISHED)
"""Topics that the analyzer records."""


def force_topics(force_type: str) -> tuple[Topic[Any], Topic[Any]]:
    """Return the topics from which a plant takes forces, with messages of that type on the first.

    The second takes commands as ros2_control sends them.
    """
    return replace(CONTROL_FORCE, type_name=force_type), JOINT_COMMANDS
