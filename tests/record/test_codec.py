import math
import struct
from contextlib import suppress

import numpy as np
import pytest
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from stickslip_ros.errors import MessageError
from stickslip_ros.record.cdr import joined
from stickslip_ros.record.codec import (
    joint_state_columns,
    joint_state_packer,
    pack_header,
    pack_joint_state,
    pack_wrench,
    references_in,
    unpack_command,
    unpack_header,
    unpack_joint_state,
    unpack_reference,
    unpack_wrench,
    wrench_columns,
)
from stickslip_ros.samples import MotorSample, Reference, Sample
from tests.record.runs import joint_state

JOINT_STATE_PADDING = (*range(17, 20), 34, 35, *range(45, 48), *range(72, 76), *range(96, 100))
WRENCH_PADDING = range(22, 28)

stamps = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
numbers = st.floats(allow_nan=False)
pairs = st.tuples(numbers, numbers)
frames = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9)


def header(stamp, frame=""):
    message = Header(frame_id=frame)
    message.stamp.sec, message.stamp.nanosec = divmod(stamp, 10**9)
    return message


def wrench(stamp, x, y=0.0, z=0.0, frame="slide"):
    return WrenchStamped(header=header(stamp, frame), wrench=Wrench(force=Vector3(x=x, y=y, z=z)))


def without(padding, data):
    """Zero the padding, in which Fast DDS leaves whatever was in memory."""
    return bytes(0 if index in padding else byte for index, byte in enumerate(data))


@given(stamps, pairs, pairs, pairs)
def test_a_joint_state_is_packed_as_rclpy_serializes_it(stamp, position, velocity, effort):
    message = joint_state(stamp, position, velocity, effort)
    packed = pack_joint_state(stamp, position, velocity, effort)
    assert packed == without(JOINT_STATE_PADDING, serialize_message(message))
    assert deserialize_message(packed, JointState) == message
    sample = Sample(stamp, position[0], velocity[0], effort[0], position[1], velocity[1])
    assert unpack_joint_state(packed) == sample


@given(stamps, numbers)
def test_a_wrench_is_packed_as_rclpy_serializes_it(stamp, force):
    message = wrench(stamp, force)
    packed = pack_wrench(stamp, force)
    assert packed == without(WRENCH_PADDING, serialize_message(message))
    assert deserialize_message(packed, WrenchStamped) == message
    assert unpack_wrench(packed) == (stamp, force)


@given(stamps, frames)
def test_a_header_is_packed_as_rclpy_serializes_it_and_read_with_any_frame(stamp, frame):
    assert pack_header(stamp) == serialize_message(header(stamp))
    assert unpack_header(pack_header(stamp)) == stamp
    assert unpack_header(serialize_message(header(stamp, frame))) == stamp


@st.composite
def foreign_joint_states(draw):
    names = draw(st.permutations(["slide", "belt", *draw(st.lists(frames, max_size=3))]))
    values = st.lists(numbers, min_size=len(names), max_size=len(names))
    position, velocity = draw(values), draw(values)
    effort = draw(st.one_of(values, st.just([])))
    message = joint_state(draw(stamps), position, velocity, effort, names, draw(frames))
    return message, list(names).index("slide"), list(names).index("belt")


@given(foreign_joint_states())
def test_joint_states_of_other_layouts_are_read(case):
    message, slide, belt = case
    sample = unpack_joint_state(serialize_message(message))
    stamp = message.header.stamp
    assert sample.stamp == stamp.sec * 10**9 + stamp.nanosec
    assert sample.position == message.position[slide]
    assert sample.velocity == message.velocity[slide]
    assert sample.belt_position == message.position[belt]
    assert sample.belt_velocity == message.velocity[belt]
    if message.effort:
        assert sample.friction_force == message.effort[slide]
    else:
        assert math.isnan(sample.friction_force)


@given(stamps, pairs, pairs, frames)
def test_big_endian_messages_are_read(stamp, position, velocity, frame):
    typestore = get_typestore(Stores.ROS2_JAZZY)
    types = typestore.types
    time = types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
    message = types["sensor_msgs/msg/JointState"](
        header=types["std_msgs/msg/Header"](stamp=time, frame_id=frame),
        name=["slide", "belt"],
        position=np.array(position),
        velocity=np.array(velocity),
        effort=np.array([]),
    )
    data = typestore.serialize_cdr(message, "sensor_msgs/msg/JointState", little_endian=False)
    assert unpack_joint_state(bytes(data))[:3] == (stamp, position[0], velocity[0])


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (joint_state(1, [1.0], [1.0], [], ["slide"]), "belt must be among them"),
        (joint_state(1, [], [], [], []), "slide and belt must be among them"),
        (joint_state(1, [], [1.0, 2.0], []), "0 positions"),
        (joint_state(1, [1.0, 2.0], [], []), "0 velocities"),
        (joint_state(1, [1.0, 2.0], [1.0], []), "1 velocities"),
        (joint_state(1, [1.0, 2.0], [1.0, 2.0], [1.0]), "1 efforts"),
        (joint_state(1, [], [], [], ["slide", "belt"] * 501), "1002 joints; must be at most 1000"),
        (joint_state(1, [], [], [], ["slide" * 10_000] * 900), "slide and belt|belt must be"),
    ],
)
def test_a_joint_state_that_lacks_something_is_refused_in_a_line(message, complaint):
    with pytest.raises(MessageError, match=complaint) as refusal:
        unpack_joint_state(serialize_message(message))
    assert len(str(refusal.value)) < 400


def test_a_reference_of_another_node_is_read_by_its_names():
    """Positions or velocities may be empty; efforts have no effect."""
    names = ["gripper", "slide"]
    sent = {(1.0, None): ([0.0, 1.0], []), (None, 2.0): ([], [0.0, 2.0])}
    for reference, values in sent.items():
        data = serialize_message(joint_state(7, *values, [9.0], names))
        columns, refused = references_in(*joined([data]))
        assert unpack_reference(data) == (7, Reference(*reference))
        assert [columns.stamp[0], refused.number] == [7, 0]
        row = [columns.position[0], columns.velocity[0]]
        assert [None if math.isnan(each) else each for each in row] == [*reference]
    with pytest.raises(MessageError, match="1 positions, 0 velocities"):
        unpack_reference(serialize_message(joint_state(7, [1.0], [], [], names)))
    with pytest.raises(MessageError, match="slide must be among them"):
        unpack_reference(serialize_message(joint_state(7, [1.0], [], [], ["gripper"])))


def test_what_is_no_message_is_refused():
    for data in (b"", b"\0", b"\0\1\0\0", b"\0\3\0\0" + bytes(112), bytes(11)):
        for unpack in (unpack_joint_state, unpack_wrench, unpack_header):
            with pytest.raises(MessageError):
                unpack(data)
    valid = pack_joint_state(1, (1.0, 2.0), (3.0, 4.0), (5.0, 6.0))
    for length in range(len(valid)):
        with pytest.raises(MessageError):
            unpack_joint_state(valid[:length])
    for offset in (12, 20, 24, 36, 48, 68, 92):
        for absurd in (2**31, 2**32 - 1):
            data = bytearray(valid)
            struct.pack_into("<I", data, offset, absurd)
            with pytest.raises(MessageError):
                unpack_joint_state(bytes(data))


@given(st.binary(max_size=150), st.integers(0, 116), st.integers(0, 116))
def test_garbage_is_read_or_refused(garbage, start, end):
    valid = pack_joint_state(1, (1.0, 2.0), (3.0, 4.0), (5.0, 6.0))
    for data in (b"\0\1\0\0" + garbage, valid[:start] + garbage + valid[end:]):
        for unpack in (unpack_joint_state, unpack_wrench, unpack_header):
            with suppress(MessageError):
                unpack(data)


def rows(columns):
    return list(zip(*(column.tolist() for column in vars(columns).values()), strict=True))


# Structures that a publisher may use: joints (further ones may be there), frame, byte order.
structures = st.tuples(
    st.lists(st.sampled_from(["slide", "belt", "a", "gripper"]), unique=True, max_size=4),
    st.sampled_from(["", "world", "slide"]),
    st.booleans(),
)


@given(
    st.lists(st.tuples(stamps, pairs, pairs, pairs, st.integers(0, 12)), max_size=40),
    st.lists(structures, min_size=13, max_size=13),
)
def test_columns_hold_what_the_single_messages_say(states, choices):
    messages = []
    for *state, choice in states:
        joints, frame, with_effort = choices[choice]
        message = joint_state(*state, joints, frame=frame) if joints else joint_state(*state)
        if joints:
            surplus = [float(n) for n in range(len(joints))]
            for name in ("position", "velocity", "effort"):
                setattr(message, name, (list(getattr(message, name)) + surplus)[: len(joints)])
            if not with_effort:
                message.effort = []
        messages.append(serialize_message(message) if choice else pack_joint_state(*state))
    expected, refusals = [], []
    for message in messages:
        try:
            expected.append(unpack_joint_state(message))
        except MessageError as error:
            refusals.append(str(error))
    columns, refused = joint_state_columns(messages)
    wanted = [(*sample[:6], *(sample.motor or (math.nan, math.nan))) for sample in expected]
    assert str(rows(columns)) == str(wanted)  # NaN is NaN
    assert columns.stamp.dtype == np.int64
    assert refused == (len(refusals), refusals[0] if refusals else "")


@given(stamps, pairs, pairs, pairs, st.text("abc_", max_size=20), st.text("abc_", max_size=20))
def test_joints_of_other_names_are_packed_as_ros_does(stamp, x, v, u, slide, belt):
    packed = joint_state_packer(slide, belt)(stamp, x, v, u)
    assert deserialize_message(packed, JointState) == joint_state(stamp, x, v, u, (slide, belt))
    assert joint_state_packer("slide", "belt")(stamp, x, v, u) == pack_joint_state(stamp, x, v, u)


def test_a_motor_is_a_third_joint() -> None:
    names, values = ["slide", "belt", "motor"], ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0))
    packed = joint_state_packer(*names)(1, *values)
    assert list(deserialize_message(packed, JointState).name) == names
    expected = Sample(1, 1.0, 4.0, 7.0, 2.0, 5.0, MotorSample(3.0, 6.0))
    turned = JointState(name=names[::-1], position=values[0][::-1], velocity=values[1][::-1])
    turned.effort = values[2][::-1]
    turned.header.stamp.nanosec = 1
    assert unpack_joint_state(packed) == expected == unpack_joint_state(serialize_message(turned))
    columns, _ = joint_state_columns([packed, pack_joint_state(1, (1, 2), (3, 4), (5, 6))])
    assert columns.motor_position.tolist()[0] == 3.0
    assert math.isnan(columns.motor_velocity[1])
    assert columns.has_motor


@pytest.mark.parametrize(
    ("effort", "found"), [([1.0, 2.0], 2.0), ([3.0], 3.0), ([], None), ([1.0, math.nan], None)]
)
def test_a_command_has_an_effort_of_the_slide_or_one(effort, found):
    message = JointState(name=["a", "slide"], position=[9.0], effort=effort)
    message.header.stamp.sec = 4
    if found is None:
        with pytest.raises(MessageError, match=r"a joint command .* effort"):
            unpack_command(serialize_message(message), "slide")
    else:
        assert unpack_command(serialize_message(message), "slide") == (4 * 10**9, found)


@given(st.lists(st.tuples(stamps, numbers, st.integers(0, 20)), max_size=40))
def test_wrench_columns_hold_what_the_single_messages_say(forces):
    messages = [
        serialize_message(wrench(stamp, force, -force, 2.0, "f" * frame))
        if frame
        else pack_wrench(stamp, force)
        for stamp, force, frame in forces
    ]
    expected = [(stamp, force) for stamp, force, _ in forces]
    assert [unpack_wrench(message) for message in messages] == expected
    columns, refused = wrench_columns(messages)
    assert refused.number == 0
    assert [*zip(columns.stamp.tolist(), columns.force.tolist(), strict=True)] == expected
