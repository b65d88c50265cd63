"""The part of a bag that is replayed, its quality of service, and refusals."""

from dataclasses import replace
from math import inf
from pathlib import Path

import pytest
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.nodes.base.endpoints import qos_profile
from stickslip_ros.nodes.replaying.player import JITTER
from stickslip_ros.nodes.replaying.selection import (
    Selection,
    installed_message_class,
    recorded_profile,
)
from stickslip_ros.record.codec import pack_header, unpack_joint_state, unpack_wrench
from stickslip_ros.record.recorder import offered_qos
from stickslip_ros.record.topics import DEEP, JOINT_STATES
from stickslip_ros.scenarios.parameters import ReplayParameters
from tests.record.runs import foreign_file, write_bag

SECOND = 1_000_000_000
STATES = "/drive/joint_states"
FORCES = "/drive/control_force"
RECORDED = "/drive/recorded"
TOPICS = (STATES, FORCES, RECORDED, "/other/recorded", "/clock")
STATE_TYPE = "sensor_msgs/msg/JointState"

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


def record(bag: Path, *messages: tuple[str, float]) -> str:
    """Write messages of a topic and a log time (s) to a bag; return its path."""
    stamps = [(topic, round(time * SECOND)) for topic, time in messages]
    write_bag(bag, [(topic, stamp, pack_header(stamp)) for topic, stamp in stamps], topics=TOPICS)
    return str(bag)


def selection(bag: str, **parameters: object) -> Selection:
    return Selection(ReplayParameters().changed({"bag": bag, **parameters}, "/replay"), "/replay")


def heard(bag: str, **parameters: object) -> list[tuple[str, float]]:
    """Return topic and log time (s) of what is to be replayed."""
    messages = selection(bag, **parameters).messages()
    return [(topic, log_time / SECOND) for topic, log_time, _ in messages]


def test_a_part_begins_and_ends_at_recorded_times(tmp_path: Path) -> None:
    run = [(topic, 5.0 + n) for n in range(10) for topic in (STATES, FORCES)]
    bag = record(tmp_path / "bag", *run)
    assert heard(bag) == run
    assert heard(bag, start=2.0, duration=3.0) == run[4:10]
    assert heard(bag, start=2.5, duration=1.0, topics=[FORCES]) == [(FORCES, 8.0)]
    assert heard(bag, start=2.0, duration=1e300) == run[4:]
    assert selection(bag).length == 9.0
    assert selection(bag, start=2.0).length == 7.0
    assert selection(bag, start=2.0, duration=3.0).length == 3.0


def test_late_messages_still_belong_to_the_part(tmp_path: Path) -> None:
    end = 7.0 + JITTER / SECOND
    run = [(STATES, 5.0), (STATES, 7.5), (FORCES, 6.9), (STATES, end), (FORCES, 6.8)]
    bag = record(tmp_path / "bag", *run)
    assert heard(bag, duration=2.0) == [(STATES, 5.0), (FORCES, 6.9)]


def test_the_first_message_need_not_be_the_earliest(tmp_path: Path) -> None:
    run = [(STATES, 5.0), (FORCES, 4.9), (STATES, 6.0), (FORCES, 5.9), (STATES, 7.0)]
    bag = record(tmp_path / "bag", *run)
    assert heard(bag) == run
    assert heard(bag, duration=1.0) == [*run[:2], run[3]]
    assert heard(bag, start=0.5) == run[2:]
    assert selection(bag).length == 2.0


def test_a_segment_of_earlier_log_times_follows_the_one_before(tmp_path: Path) -> None:
    times = (11.0, 12.0, 13.0, 1.0, 2.0, 3.0)
    run = [(STATES, time) for time in times]
    bag = record(tmp_path / "bag", *run)
    assert heard(bag) == run
    assert heard(bag, start=1.0, duration=3.0) == run[1:4]
    assert heard(bag, start=4.0) == run[4:]
    assert selection(bag).length == inf
    with pytest.raises(InvalidInputError, match="is 5 s long"):
        selection(bag, start=6.0)


def test_topics_of_live_nodes_only_are_omitted_unless_requested(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", (STATES, 1.0), (RECORDED, 1.0))
    assert set(selection(bag).topics) == set(TOPICS) - {RECORDED}
    assert set(selection(bag, clock=True).topics) == set(TOPICS) - {RECORDED, "/clock"}
    assert set(selection(bag, topics=[RECORDED]).topics) == {RECORDED}


def test_the_motion_of_another_machine_is_that_of_our_plant(tmp_path: Path) -> None:
    messages: list[tuple[str, int, bytes]] = []
    for number in range(3):
        state = JointState(name=["arm", "axis"], position=[9.0, 1.0 * number], velocity=[0.0, 2.0])
        state.header.stamp.sec = 10 + number
        command = serialize_message(Float64(data=5.0 + number))
        messages += [("/m/joint_states", (10 + number) * SECOND, serialize_message(state))]
        messages += [("/m/command", (10 + number) * SECOND, command)]
    write_bag(tmp_path / "bag", messages)
    machine = {"joint": "axis", "belt_speed": 0.04, "force_topic": "/m/command"}
    part = selection(str(tmp_path / "bag"), start=1.0, **machine)
    assert set(part.topics) == {"/m/joint_states", "/m/control_force"}
    sent = [(topic, data) for topic, _, data in part.messages()]
    samples = [unpack_joint_state(data) for topic, data in sent if topic == "/m/joint_states"]
    forces = [unpack_wrench(data) for topic, data in sent if topic == "/m/control_force"]
    assert [sample[:3] for sample in samples] == [(11 * SECOND, 1.0, 2.0), (12 * SECOND, 2.0, 2.0)]
    assert samples[0].belt_velocity == 0.04
    assert forces == [(11 * SECOND, 6.0), (12 * SECOND, 7.0)]


def foreign_bag(file: Path, types: dict[str, str]) -> str:
    """Write one message on each topic to a file as a recorder with other message types would."""
    with foreign_file(file) as writer:
        for topic, kind in types.items():
            schema = writer.register_schema(kind, "ros2msg", b"")
            writer.add_message(writer.register_channel(topic, "cdr", schema), 5, bytes(12), 5)
    return str(file)


def test_what_cannot_be_published_is_left_out_with_the_reason(tmp_path: Path) -> None:
    types = {STATES: STATE_TYPE, "/thing": "nosuch_msgs/msg/Thing", "/a b": STATE_TYPE}
    part = selection(foreign_bag(tmp_path / "bag.mcap", types))
    assert part.topics.keys() == {STATES}
    assert [topic for topic, _, _ in part.messages()] == [STATES]
    thing, name = sorted(part.left_out, reverse=True)
    assert "/thing is omitted: the message type 'nosuch_msgs/msg/Thing' is not installed" in thing
    assert "/a b is omitted" in name
    del types[STATES]
    with pytest.raises(BagError, match=r"no topic of the bag .* can be replayed: .*nosuch_msgs"):
        selection(foreign_bag(tmp_path / "other.mcap", types))


def test_what_the_bag_lacks_is_known_when_it_was_read(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", (STATES, 1.0), (STATES, 2.0))
    (tmp_path / "bag" / "metadata.yaml").unlink()
    part = selection(bag)
    assert len(list(part.messages())) == 2
    assert "metadata.yaml" in " ".join(part.lacking)


def test_invalid_input_is_refused(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", (STATES, 1.0), (STATES, 2.0), (STATES, 5.0))
    refusals: list[tuple[dict[str, object], tuple[str, ...]]] = [
        ({"bag": ""}, ("/replay: bag = ''", "path of a bag")),
        ({"bag": "nosuch"}, ("nosuch", "does not exist")),
        ({"bag": record(tmp_path / "empty")}, ("no messages",)),
        ({"start": 5.0}, ("/replay: start = 5.0 s", "nothing was recorded", "4 s long")),
        ({"start": 1e300}, ("/replay: start = 1e+300", "at most 1e+10 s")),
        ({"start": 1.5, "duration": 1.0}, ("duration = 1.0 s", "nothing was recorded")),
        ({"topics": [RECORDED]}, ("nothing was recorded then on /drive/recorded",)),
        ({"topics": ["/nosuch"]}, ("/replay: topics = ['/nosuch']", STATES, FORCES)),
        ({"topics": ["joint_states"]}, ("topics = ['joint_states']", STATES)),
    ]
    for parameters, named in refusals:
        with pytest.raises(InvalidInputError) as refusal:
            selection(**{"bag": bag, **parameters})
        for text in named:
            assert text in str(refusal.value)


def test_a_recorded_profile_is_offered_again() -> None:
    profile = recorded_profile(NAMES)
    assert recorded_profile(NUMBERS) == profile
    assert profile.reliability is ReliabilityPolicy.BEST_EFFORT
    assert profile.durability is DurabilityPolicy.VOLATILE
    assert profile.liveliness is LivelinessPolicy.AUTOMATIC
    assert profile.deadline.nanoseconds == 2_500_000_000
    assert (profile.history, profile.depth) == (HistoryPolicy.KEEP_LAST, DEEP)
    for topic in (JOINT_STATES, replace(JOINT_STATES, durability="transient_local", depth=7)):
        ours = recorded_profile(offered_qos(topic.depth, topic.reliability, topic.durability))
        for policy in ("history", "depth", "reliability", "durability"):
            assert getattr(ours, policy) == getattr(qos_profile(topic), policy)
    # No depth is too deep for the middleware; a latched topic keeps what it kept.
    assert recorded_profile(f"- {{history: keep_last, depth: {2**40}}}").depth == 100_000
    latched = recorded_profile("- {durability: transient_local, depth: 1, history: keep_last}")
    assert (latched.durability, latched.depth) == (DurabilityPolicy.TRANSIENT_LOCAL, 1)


def test_where_no_profile_can_be_taken_over_the_topic_is_reliable() -> None:
    for recorded in (
        "", "[]", "nonsense", "{unfinished", "- 3", "- reliability: superb",
        "- reliability: [reliable]", "- depth: many", "- deadline: soon",
        "- reliability: unknown\n  durability: system_default",
        f"{NAMES}- reliability: reliable", "[" * 500,
    ):  # fmt: skip
        assert recorded_profile(recorded) == QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=DEEP,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.VOLATILE,
            liveliness=LivelinessPolicy.AUTOMATIC,
        ), recorded


def test_a_type_is_found_by_its_name_or_refused() -> None:
    assert installed_message_class("sensor_msgs/msg/JointState") is JointState
    for name in ("nosuch_msgs/msg/A", "sensor_msgs/msg/Nosuch", "JointState", "os/msg/path", ""):
        with pytest.raises(BagError, match="message type"):
            installed_message_class(name)
