"""The topics: name, type, depth of history, meaning and decoder, each once; no ROS.

Names are relative to the namespace.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from stickslip_ros.messages.codec import unpack_header, unpack_joint_state, unpack_wrench

MessageT = TypeVar("MessageT")

DEEP = 4_900
"""Messages that wait for a reader that falls behind; above 5,000, Fast DDS delays the writer."""

_WRENCH = "geometry_msgs/msg/WrenchStamped"
_NUMBER = "std_msgs/msg/Float64"


@dataclass(frozen=True)
class Topic(Generic[MessageT]):
    """A topic that nodes of this package write or read; reliable, with bounded history."""

    name: str
    type_name: str
    depth: int = 10
    meaning: str = ""
    decode: Callable[[bytes], MessageT] | None = None
    """Reads a serialized message, or raises BagError; None: as ROS does, into an object."""


JOINT_STATES = Topic(
    "joint_states",
    "sensor_msgs/msg/JointState",
    DEEP,
    meaning="State at each sample: `name` slide and belt, `position` m, `velocity` m/s, `effort` N "
    "(friction on the slide, its reaction on the belt, under the force held up to then).",
    decode=unpack_joint_state,
)
CONTROL_FORCE = Topic(
    "control_force",
    _WRENCH,
    DEEP,
    meaning="Force on the slide, `wrench.force.x` N, with the stamp of the state that it answers.",
    decode=unpack_wrench,
)
DISTURBANCE_FORCE = Topic(
    "disturbance_force",
    _WRENCH,
    meaning="A force of yours on the slide, `wrench.force.x` N, from the next sample on until the "
    "next message; its stamp does not matter.",
    decode=unpack_wrench,
)
APPLIED_DISTURBANCE = Topic(
    "applied_disturbance",
    _WRENCH,
    DEEP,
    meaning="All the disturbance that acts, `wrench.force.x` N, at each change, with the stamp of "
    "the sample from which it acts.",
    decode=unpack_wrench,
)
DROPPED_FORCE = Topic(
    "dropped_force",
    _WRENCH,
    DEEP,
    meaning="Each `control_force` that did not act, as it was sent: refused, overtaken by a newer "
    "one, or come while the plant was not active.",
    decode=unpack_wrench,
)
RECORDED = Topic(
    "recorded",
    "std_msgs/msg/Header",
    100,
    meaning="Stamp of the newest sample that the analyzer has taken in.",
    decode=unpack_header,
)
AMPLITUDE: Topic[Any] = Topic(
    "limit_cycle/amplitude",
    _NUMBER,
    meaning="Half the peak-to-peak displacement of each cycle, m; none while the slide rests.",
)
STICK_FRACTION: Topic[Any] = Topic(
    "limit_cycle/stick_fraction",
    _NUMBER,
    meaning="Share of that cycle during which the slide stuck.",
)
FREQUENCY: Topic[Any] = Topic(
    "limit_cycle/frequency", _NUMBER, meaning="One over the period of that cycle, Hz."
)
DIAGNOSTICS: Topic[Any] = Topic(
    "/diagnostics",
    "diagnostic_msgs/msg/DiagnosticArray",
    100,
    meaning="Health of the node, once a second of wall time, and when it is deactivated.",
)
CLOCK: Topic[Any] = Topic(
    "/clock",
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
