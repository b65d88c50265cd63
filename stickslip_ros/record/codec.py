"""Pack and unpack the messages of the control loop and of the bag.

With fixed joints and a fixed frame all messages have the same length, so that each one is packed
and unpacked in one step. Messages with another layout, from other publishers, are decoded field by
field.
"""

import reprlib
import struct
from collections.abc import Callable, Sequence
from functools import partial
from math import isnan
from typing import TypeVar

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError, MessageError
from stickslip_ros.record.cdr import LITTLE_ENDIAN, Decoder, Layout, Refused, decode, joined
from stickslip_ros.samples import (
    ForceColumns,
    MotorSample,
    Reference,
    ReferenceColumns,
    Sample,
    SampleColumns,
)
from stickslip_ros.stamps import NANOSECONDS

SLIDE = "slide"
BELT = "belt"
MOTOR = "motor"
HELD = "held"
"""Frame of a joint state that asks for no force: the plant holds the last one."""

FORCE_TYPES = (
    "geometry_msgs/msg/WrenchStamped",
    "std_msgs/msg/Float64",
    "std_msgs/msg/Float64MultiArray",
    "sensor_msgs/msg/JointState",
)
"""Types of messages that may hold a force."""
UNSTAMPED = FORCE_TYPES[1:3]
"""Those that have no stamp."""

_ColumnsT = TypeVar("_ColumnsT", SampleColumns, ForceColumns, ReferenceColumns)

_MOST_JOINTS = 1000
"""Messages with more joints are refused: decoding might take longer than a sample."""


def _name(name: str) -> bytes:
    """Encode a CDR string: length with the closing zero, the characters, the zero."""
    return struct.pack("<I", len(name) + 1) + name.encode() + b"\x00"


def _joint_state_structure(*names: str, frame: str = "") -> tuple[struct.Struct, bytes]:
    """Return the structure of a joint state, and the bytes that name its joints."""
    joints, count = b"", len(names)
    for part in (_name(frame), struct.pack("<I", count), *map(_name, names), b""):
        joints += bytes(-len(joints) % 4) + part
    padding = (4 - len(joints)) % 8
    values = f"{count}d I4x{count}d I4x{count}d"
    return struct.Struct(f"<4s iI {len(joints)}s I{padding}x{values}"), joints


_JOINT_STATE, _JOINTS = _joint_state_structure(SLIDE, BELT)
_JOINT_STATE_CONSTANTS = (LITTLE_ENDIAN, _JOINTS, 2, 2, 2)
_REFERENCE_JOINT = _name("") + bytes(3) + struct.pack("<I", 1) + _name(SLIDE) + bytes(2)
_MOTOR_STATE, _MOTOR_JOINTS = _joint_state_structure(SLIDE, BELT, MOTOR)
# The components of the wrench other than force.x are zero when packed and skipped when unpacked.
_WRENCH = struct.Struct("<4s iI 10s6x d40x")
_WRENCH_FRAME = _name(SLIDE)
_WRENCH_CONSTANTS = (LITTLE_ENDIAN, _WRENCH_FRAME)
_STAMP = struct.Struct("<4s iI")
_HEADER = struct.Struct("<4s iI 5s")
_HELD = struct.Struct("<4s iI 9s")


def joint_state_packer(
    *names: str, frame: str = ""
) -> Callable[[int, Sequence[float], Sequence[float], Sequence[float]], bytes]:
    """Return a function that serializes a sensor_msgs/msg/JointState of joints in this order.

    It takes the stamp in ns, then the positions in m, velocities in m/s and efforts in N, one of
    each joint. It raises MessageError for a stamp outside ROS time (32-bit seconds). `frame` is the
    frame of the header.
    """
    (layout, joints), n = _joint_state_structure(*names, frame=frame), len(names)

    def pack(
        stamp: int, position: Sequence[float], velocity: Sequence[float], effort: Sequence[float]
    ) -> bytes:
        return _packed("joint state", layout, stamp, joints, n, *position, n, *velocity, n, *effort)

    return pack


pack_joint_state = joint_state_packer(SLIDE, BELT)
"""Serializes a joint state of slide and belt, see `joint_state_packer`."""


def pack_reference(stamp: int, reference: Reference) -> bytes:
    """Serialize a sensor_msgs/msg/JointState of the joint `slide`; stamp in ns, values in SI units.

    What the reference does not give is empty; there is no field for the acceleration. Raises
    MessageError for a stamp outside ROS time (32-bit seconds).
    """
    message = _packed("reference", _STAMP, stamp) + _REFERENCE_JOINT
    for value in (reference.position, reference.velocity):
        message += struct.pack("<I", value is not None)
        if value is not None:  # aligned to 8 bytes from the end of the encapsulation
            message += bytes((len(LITTLE_ENDIAN) - len(message)) % 8) + struct.pack("<d", value)
    return message + struct.pack("<I", 0)


def pack_wrench(stamp: int, force_x: float) -> bytes:
    """Serialize a geometry_msgs/msg/WrenchStamped of a force along x (N) in the frame `slide`.

    Stamp in ns. Raises MessageError for a stamp outside ROS time (32-bit seconds).
    """
    return _packed("wrench", _WRENCH, stamp, _WRENCH_FRAME, force_x)


def pack_header(stamp: int) -> bytes:
    """Serialize a std_msgs/msg/Header of a stamp in ns, with no frame.

    Raises MessageError for a stamp outside ROS time (32-bit seconds).
    """
    return _packed("header", _HEADER, stamp, _name(""))


def unpack_joint_state(data: bytes) -> Sample:
    """Read slide and belt, and a motor if there is one, from a serialized JointState.

    Any frame, byte order and order of the joints is accepted, and so are further joints. Raises
    MessageError for other bytes, and if a joint, its position or its velocity is missing.
    """
    if len(data) == _JOINT_STATE.size:
        layout, sec, nanosec, joints, count, x, belt, velocities, v, belt_v, efforts, effort, _ = (
            _JOINT_STATE.unpack(data)
        )
        if (layout, joints, count, velocities, efforts) == _JOINT_STATE_CONSTANTS:
            return Sample(sec * NANOSECONDS + nanosec, x, v, effort, belt, belt_v)
    if len(data) == _MOTOR_STATE.size:
        encapsulation, sec, nanosec, joints, count, *values = _MOTOR_STATE.unpack(data)
        constants = encapsulation, joints, count, values[3], values[7]
        if constants == (LITTLE_ENDIAN, _MOTOR_JOINTS, 3, 3, 3):
            x, belt, motor, _, v, belt_v, motor_v, _, effort, *_ = values
            stamp = sec * NANOSECONDS + nanosec
            return Sample(stamp, x, v, effort, belt, belt_v, MotorSample(motor, motor_v))
    stamp, values = joint_state_layout(data).read(data)
    x, v, effort, belt, belt_v, *motor = values
    moved = None if isnan(motor[0]) else MotorSample(*motor)
    return Sample(stamp, x, v, effort, belt, belt_v, moved)


def unpack_asking_state(data: bytes) -> Sample | None:
    """Read a joint state as `unpack_joint_state` does, or return None if it asks for no force."""
    frame = _HELD.size
    if len(data) >= frame and _HELD.unpack_from(data)[3] == _name(HELD):
        return None
    return unpack_joint_state(data)


def unpack_reference(data: bytes) -> tuple[int, Reference]:
    """Read stamp (ns) and reference of the slide from a serialized sensor_msgs/msg/JointState.

    Positions or velocities may be empty, and NaN is the same as none. Raises MessageError for other
    bytes, and if the slide is not among the joints.
    """
    stamp, (position, velocity) = _reference_layout(data).read(data)
    return stamp, Reference(
        None if isnan(position) else position, None if isnan(velocity) else velocity
    )


def unpack_wrench(data: bytes) -> tuple[int, float]:
    """Read the stamp (ns) and `force.x` (N) from a serialized geometry_msgs/msg/WrenchStamped.

    Any frame and byte order is accepted. Raises MessageError for other bytes.
    """
    if len(data) == _WRENCH.size:
        encapsulation, sec, nanosec, frame, force = _WRENCH.unpack(data)
        if (encapsulation, frame) == _WRENCH_CONSTANTS:
            return sec * NANOSECONDS + nanosec, force
    stamp, (force,) = _wrench_layout(data).read(data)
    return stamp, force


def unpack_command(data: bytes, joint: str) -> tuple[int, float]:
    """Read stamp (ns) and effort (N) of a joint from a serialized command, a JointState.

    There must be one effort for each joint, or a single one. Raises MessageError for other bytes.
    """
    stamp, (force,) = _command_layout(data, joint).read(data)
    if isnan(force):
        raise MessageError(f"a joint command has no number as effort of {joint}")
    return stamp, force


def unpack_force(layout_of: Callable[[bytes], Layout], data: bytes) -> tuple[int, float]:
    """Read stamp (ns, 0 without one) and force (N) by one of `force_layouts`.

    Raises what the layout does.
    """
    stamp, (force,) = layout_of(data).read(data)
    return stamp, force


def unpack_header(data: bytes) -> int:
    """Read the stamp (ns) from a serialized std_msgs/msg/Header, or a message starting with one.

    Raises MessageError for other bytes.
    """
    if data[:4] == LITTLE_ENDIAN and len(data) >= _STAMP.size:
        _, sec, nanosec = _STAMP.unpack_from(data)
        return sec * NANOSECONDS + nanosec
    message = Decoder(data, "header")
    return Layout(message, message.header_stamp(), []).read(data)[0]


def joint_state_columns(messages: Sequence[bytes]) -> tuple[SampleColumns, Refused]:
    """Decode serialized joint states; also return what `unpack_joint_state` would refuse."""
    return joint_states_in(*joined(messages))


def wrench_columns(messages: Sequence[bytes]) -> tuple[ForceColumns, Refused]:
    """Decode serialized wrenches; also return what `unpack_wrench` would refuse."""
    return wrenches_in(*joined(messages))


def force_layouts(joint: str | None, number: int | None) -> dict[str, Callable[[bytes], Layout]]:
    """Return what finds the force in messages of each type, by the name of the type.

    `joint` is the one whose effort is taken of joint commands, by default the slide or the only
    one, and `number` the place in an array, from 1. A layout raises MessageError for a message that
    has no force, and BagError if the joint or the number must be given.
    """
    layouts = (
        _wrench_layout,
        _number_layout,
        partial(_array_layout, number=number),
        partial(_command_layout, joint=joint),
    )
    return dict(zip(FORCE_TYPES, layouts, strict=True))


def _packed(kind: str, layout: struct.Struct, stamp: int, *values: float | bytes) -> bytes:
    """Pack the encapsulation, a stamp in ns, and values."""
    try:
        return layout.pack(LITTLE_ENDIAN, stamp // NANOSECONDS, stamp % NANOSECONDS, *values)
    except struct.error as error:
        raise MessageError(
            f"a {kind} with the stamp {stamp} ns cannot be serialized ({error}); "
            "stamps must be within 32-bit seconds, values must be numbers"
        ) from error


def joint_state_layout(data: bytes) -> Layout:
    """Return where a joint state has what `unpack_joint_state` reads; raises MessageError."""
    joints = _Joints(data, "joint state", SLIDE, BELT)
    joints.check_counts(always=2)
    return joints.layout(SLIDE, BELT, MOTOR)


def joint_layout(data: bytes, joint: str, belt: str | None, kind: str) -> Layout:
    """Return where a message has position, velocity and effort of a joint, and those of a belt.

    The message is of one of `STATE_TYPES`. What it lacks is missing: each sequence may be empty,
    and a joint not among the names.
    """
    joints = STATE_TYPES[kind](data, "joint state")
    joints.check_counts()
    return joints.layout(joint, belt, None)


def _reference_layout(data: bytes) -> Layout:
    joints = _Joints(data, "reference", SLIDE)
    joints.check_counts(fields=2)
    return joints.layout_of(joints.place(0, SLIDE), joints.place(1, SLIDE))


class _Joints:
    """The joints in a serialized JointState, and where it has what of them."""

    def __init__(self, data: bytes, kind: str, *needed: str) -> None:
        """Raise MessageError for other bytes, and if a joint is needed and not there."""
        self._message = message = Decoder(data, kind)
        self._kind, self._stamp = kind, message.header_stamp()
        self.names = self._strings()
        self.sequences = self._sequences(message)
        """Where the positions, velocities and efforts are, and their counts."""
        missing = " and ".join(joint for joint in needed if joint not in self.names)
        if missing:
            raise MessageError(
                f"a {kind} names the joints {reprlib.repr(self.names)}; {missing} must be among "
                "them"
            )

    def _strings(self) -> list[str]:
        number = self._message.count()
        if number > _MOST_JOINTS:
            raise MessageError(
                f"a {self._kind} has {number} joints; must be at most {_MOST_JOINTS}"
            )
        return [self._message.string() for _ in range(number)]

    def _sequences(self, message: Decoder) -> list[tuple[int, int]]:
        return [message.doubles(message.count()) for _ in range(3)]

    def check_counts(self, fields: int = 3, always: int = 0) -> None:
        """Refuse sequences without one value per joint; all but the first `always` may be empty."""
        counts, number = [count for _, count in self.sequences], len(self.names)
        if {*counts[:always]} <= {number} and {*counts[:fields]} <= {0, number}:
            return
        raise MessageError(
            f"a {self._kind} of the joints {reprlib.repr(self.names)} has {counts[0]} positions, "
            f"{counts[1]} velocities and {counts[2]} efforts; must be one for each joint, or "
            f"{'no efforts' if always else 'none'}"
        )

    def place(self, field: int, joint: str | None) -> int | None:
        """Return where the position (0), velocity (1) or effort (2) of a joint is."""
        start, count = self.sequences[field]
        return start + 8 * self.names.index(joint) if count and joint in self.names else None

    def layout(self, joint: str, *others: str | None) -> Layout:
        """Return position, velocity and effort of a joint, and of others the first two."""
        places = [self.place(field, joint) for field in range(3)]
        return self.layout_of(*places, *(self.place(n, name) for name in others for n in (0, 1)))

    def layout_of(self, *places: int | None) -> Layout:
        """Return the layout of places."""
        return Layout(self._message, self._stamp, places)


class _DynamicJoints(_Joints):
    """The joints in a control_msgs/msg/DynamicJointState: each with interfaces of its own."""

    def _sequences(self, message: Decoder) -> list[tuple[int, int]]:
        self._places: dict[tuple[int, str], int] = {}
        for number in range(message.count()):
            interfaces = self._strings()
            start, count = message.doubles(message.count())
            for place, name in enumerate(interfaces[:count]):
                self._places[number, name] = start + 8 * place
        return [(0, 0)] * 3

    def place(self, field: int, joint: str | None) -> int | None:
        if joint not in self.names:
            return None
        interface = ("position", "velocity", "effort")[field]
        return self._places.get((self.names.index(joint), interface))


class _ControllerJoints(_Joints):
    """The joints in a control_msgs/msg/JointTrajectoryControllerState, as they were measured."""

    def _sequences(self, message: Decoder) -> list[tuple[int, int]]:
        # In older versions they are the desired and the actual point.
        self.reference = [message.doubles(message.count()) for _ in range(4)]
        message.skip_duration()
        feedback = [message.doubles(message.count()) for _ in range(4)]
        return [*feedback[:2], feedback[3]]


CONTROLLER_STATE = "control_msgs/msg/JointTrajectoryControllerState"
STATE_TYPES = {
    "sensor_msgs/msg/JointState": _Joints,
    "control_msgs/msg/DynamicJointState": _DynamicJoints,
    CONTROLLER_STATE: _ControllerJoints,
}
"""What reads messages with the motion of joints, by their types."""


def _wrench_layout(data: bytes) -> Layout:
    message = Decoder(data, "wrench")
    stamp = message.header_stamp()
    force, _ = message.doubles(6)
    return Layout(message, stamp, [force])


def _number_layout(data: bytes) -> Layout:
    message = Decoder(data, "number")
    return Layout(message, None, [message.doubles(1)[0]])


def _array_layout(data: bytes, number: int | None) -> Layout:
    message = Decoder(data, "array")
    for _ in range(message.count()):  # the dimensions: label, size and stride of each
        message.string()
        message.count()
        message.count()
    message.count()
    start, count = message.doubles(message.count())
    if number is None and count > 1:
        raise BagError(
            f"an array of forces has {count} numbers: --force-topic 'NAME[1]' takes the first, as "
            "force_number 1 of a node does"
        )
    if (number or 1) > count:
        raise MessageError(f"an array of forces has {count} numbers, and no number {number or 1}")
    return Layout(message, None, [start + 8 * ((number or 1) - 1)])


def _command_layout(data: bytes, joint: str | None) -> Layout:
    joints = _Joints(data, "joint command")
    names, (start, efforts) = joints.names, joints.sequences[2]
    name = joint or (SLIDE if SLIDE in names or len(names) != 1 else names[0])
    if joint is None and efforts == len(names) and name not in names:
        raise BagError(
            f"joint commands have efforts of {reprlib.repr(names)}: --joint must choose one"
        )
    if efforts == len(names):
        return joints.layout_of(joints.place(2, name))
    if efforts == 1:  # joints without an effort interface have none
        return joints.layout_of(start)
    raise MessageError(
        f"a joint command of the joints {reprlib.repr(names)} has {efforts} efforts; must be one, "
        "or one for each joint"
    )


def _columns_in(
    columns: type[_ColumnsT], number: int, layout_of: Callable[[bytes], Layout]
) -> Callable[[bytes, IntArray, IntArray], tuple[_ColumnsT, Refused]]:
    def decoded(data: bytes, begin: IntArray, end: IntArray) -> tuple[_ColumnsT, Refused]:
        _, stamp, values, refused = decode(data, begin, end, layout_of, number)
        return columns(stamp, *values), refused

    return decoded


joint_states_in = _columns_in(SampleColumns, 7, joint_state_layout)
wrenches_in = _columns_in(ForceColumns, 1, _wrench_layout)
references_in = _columns_in(ReferenceColumns, 2, _reference_layout)
"""Each decodes serialized messages `data[begin[i] : end[i]]`, and returns what is refused, too."""


def controller_references_in(
    joint: str | None,
) -> Callable[[bytes, IntArray, IntArray], tuple[ReferenceColumns, Refused]]:
    """Return what decodes references of a JointTrajectoryController, of a joint or the only one."""

    def layout_of(message: bytes) -> Layout:
        joints = _ControllerJoints(message, "controller state")
        joints.sequences = joints.reference
        name = joints.names[0] if joint is None and joints.names else joint
        return joints.layout_of(joints.place(0, name), joints.place(1, name))

    return _columns_in(ReferenceColumns, 2, layout_of)
