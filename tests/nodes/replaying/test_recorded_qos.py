"""Message types and quality of service of recorded topics."""

import pytest
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from sensor_msgs.msg import JointState

from stickslip_ros.bags.recorder import QosProfile
from stickslip_ros.errors import BagError
from stickslip_ros.messages.topics import DEEP, JOINT_STATES
from stickslip_ros.nodes.base.ros_topics import qos_profile
from stickslip_ros.nodes.replaying.recorded_qos import installed_message_class, recorded_profile

# As rosbag2 keeps them: names since Iron, numbers before; `unknown` is what Fast DDS tells.
NUMBERS = """
- history: 3
  depth: 0
  reliability: 2
  durability: 2
  deadline:
    sec: 2
    nsec: 500000000
  lifespan:
    sec: 2147483647
    nsec: 4294967295
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
"""
NAMES = """
- history: unknown
  depth: 0
  reliability: best_effort
  durability: volatile
  deadline: {sec: 2, nsec: 500000000}
  lifespan: {sec: 2147483647, nsec: 4294967295}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
LATCHED = "- {durability: transient_local, depth: 1, history: keep_last, reliability: reliable}"


def test_names_and_numbers_say_the_same() -> None:
    profile = recorded_profile(NAMES)
    assert recorded_profile(NUMBERS) == profile
    assert profile.reliability is ReliabilityPolicy.BEST_EFFORT
    assert profile.durability is DurabilityPolicy.VOLATILE
    assert profile.liveliness is LivelinessPolicy.AUTOMATIC
    assert profile.deadline.nanoseconds == 2_500_000_000
    assert (profile.history, profile.depth) == (HistoryPolicy.KEEP_LAST, DEEP)


def test_our_own_profile_comes_back() -> None:
    ours = qos_profile(JOINT_STATES)
    profile = recorded_profile(QosProfile(depth=JOINT_STATES.depth).to_yaml())
    for policy in ("history", "depth", "reliability", "durability"):
        assert getattr(profile, policy) == getattr(ours, policy)


def test_no_depth_is_too_deep_for_the_middleware() -> None:
    assert recorded_profile(f"- {{history: keep_last, depth: {2**40}}}").depth == 100_000


def test_a_latched_topic_keeps_what_it_kept() -> None:
    profile = recorded_profile(LATCHED)
    assert profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
    assert profile.depth == 1


@pytest.mark.parametrize(
    "recorded",
    [
        "",
        "[]",
        "nonsense",
        "{unfinished",
        "- 3",
        "- reliability: superb",
        "- reliability: [reliable]",
        "- depth: many",
        "- deadline: soon",
        "- reliability: unknown\n  durability: system_default",
        f"{NAMES}- reliability: reliable",
        "[" * 500,
    ],
)
def test_where_nothing_can_be_taken_over_the_topic_is_reliable(recorded: str) -> None:
    assert recorded_profile(recorded) == QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=DEEP,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
        liveliness=LivelinessPolicy.AUTOMATIC,
    )


def test_a_type_is_found_by_its_name() -> None:
    assert installed_message_class("sensor_msgs/msg/JointState") is JointState


@pytest.mark.parametrize(
    "name", ["nosuch_msgs/msg/Thing", "sensor_msgs/msg/Nosuch", "JointState", "os/msg/path", ""]
)
def test_a_type_that_is_not_installed_is_refused(name: str) -> None:
    with pytest.raises(BagError, match="message type"):
        installed_message_class(name)
