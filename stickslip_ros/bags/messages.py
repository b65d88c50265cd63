"""The byte layout (CDR) of the messages that go round the control loop and into the bag.

CDR aligns every number to its own size, counted from behind a four-byte encapsulation header. With
fixed joints and a fixed frame all messages have one length, so that each is packed and unpacked in
one step, and a block of them is a table. Messages laid out otherwise, as other publishers may send
them, are decoded field by field. Padding is never looked at: Fast DDS leaves in it, and behind the
last field, whatever was in memory.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip_ros.errors import BagError
from stickslip_ros.physics.samples import NANOSECONDS

SLIDE = "slide"
BELT = "belt"

_LITTLE_ENDIAN = b"\x00\x01\x00\x00"


class JointStateSample(NamedTuple):
    """What one joint state says of slide and belt."""

    stamp: int
    """Header stamp in ns."""
    position: float
    """Displacement of the slide in m."""
    velocity: float
    """Velocity of the slide in m/s."""
    effort: float
    """Friction force on the slide in N; NaN where the message has no efforts."""
    belt_position: float
    """Displacement of the belt in m."""
    belt_velocity: float
    """Velocity of the belt in m/s."""


@dataclass(frozen=True, eq=False)
class JointStateColumns:
    """A block of joint states: the fields of `JointStateSample` as arrays of shape (messages,)."""

    stamp: NDArray[np.int64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    belt_position: NDArray[np.float64]
    belt_velocity: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WrenchColumns:
    """A block of wrenches: header stamp in ns and `force.x` in N, arrays of shape (messages,)."""

    stamp: NDArray[np.int64]
    force: NDArray[np.float64]


def _name(name: str) -> bytes:
    """Encode a CDR string: length with the closing zero, the characters, the zero."""
    return struct.pack("<I", len(name) + 1) + name.encode() + b"\x00"


_JOINT_STATE = struct.Struct("<4s iI 5s3x 14s2x 9s3x I2d I4x2d I4x2d")
_JOINT_STATE_FRAME = _name("")
_JOINT_STATE_SLIDE = struct.pack("<I", 2) + _name(SLIDE)
_JOINT_STATE_BELT = _name(BELT)
_JOINT_STATE_CONSTANTS = (
    _LITTLE_ENDIAN,
    _JOINT_STATE_FRAME,
    _JOINT_STATE_SLIDE,
    _JOINT_STATE_BELT,
    2,
    2,
    2,
)
_JOINT_STATE_TABLE = np.dtype(
    {
        "names": ["sec", "nanosec", "position", "velocity", "effort"],
        "formats": ["<i4", "<u4", "(2,)<f8", "(2,)<f8", "(2,)<f8"],
        "offsets": [4, 8, 52, 76, 100],
        "itemsize": _JOINT_STATE.size,
    }
)

# The components of the wrench other than force.x are zero when packed and skipped when unpacked.
_WRENCH = struct.Struct("<4s iI 10s6x d40x")
_WRENCH_FRAME = _name(SLIDE)
_WRENCH_CONSTANTS = (_LITTLE_ENDIAN, _WRENCH_FRAME)
_WRENCH_TABLE = np.dtype(
    {
        "names": ["sec", "nanosec", "force"],
        "formats": ["<i4", "<u4", "<f8"],
        "offsets": [4, 8, 28],
        "itemsize": _WRENCH.size,
    }
)

_STAMP = struct.Struct("<4s iI")
_HEADER = struct.Struct("<4s iI 5s")


def pack_joint_state(
    stamp: int,
    position: tuple[float, float],
    velocity: tuple[float, float],
    effort: tuple[float, float],
) -> bytes:
    """Serialize a sensor_msgs/msg/JointState of slide and belt, in this order, with no frame.

    Stamp in ns, positions in m, velocities in m/s, efforts in N. Raises BagError for a stamp that
    ROS time (32-bit seconds) does not hold.
    """
    try:
        return _JOINT_STATE.pack(
            _LITTLE_ENDIAN,
            stamp // NANOSECONDS,
            stamp % NANOSECONDS,
            _JOINT_STATE_FRAME,
            _JOINT_STATE_SLIDE,
            _JOINT_STATE_BELT,
            2,
            *position,
            2,
            *velocity,
            2,
            *effort,
        )
    except struct.error as error:
        raise _unpackable("joint state", stamp, error) from error


def pack_wrench(stamp: int, force_x: float) -> bytes:
    """Serialize a geometry_msgs/msg/WrenchStamped of a force along x (N) in the frame `slide`.

    Stamp in ns. Raises BagError for a stamp that ROS time (32-bit seconds) does not hold.
    """
    try:
        return _WRENCH.pack(
            _LITTLE_ENDIAN,
            stamp // NANOSECONDS,
            stamp % NANOSECONDS,
            _WRENCH_FRAME,
            force_x,
        )
    except struct.error as error:
        raise _unpackable("wrench", stamp, error) from error


def pack_header(stamp: int) -> bytes:
    """Serialize a std_msgs/msg/Header of a stamp in ns, with no frame.

    Raises BagError for a stamp that ROS time (32-bit seconds) does not hold.
    """
    try:
        return _HEADER.pack(_LITTLE_ENDIAN, *divmod(stamp, NANOSECONDS), _name(""))
    except struct.error as error:
        raise _unpackable("header", stamp, error) from error


def unpack_joint_state(data: bytes) -> JointStateSample:
    """Read slide and belt out of a serialized sensor_msgs/msg/JointState.

    Any frame, byte order and order of the joints will do, and further joints may be there. Raises
    BagError for other bytes, and where a joint, its position or its velocity is missing.
    """
    if len(data) == _JOINT_STATE.size:
        (
            encapsulation,
            sec,
            nanosec,
            frame,
            slide,
            belt,
            position_count,
            position,
            belt_position,
            velocity_count,
            velocity,
            belt_velocity,
            effort_count,
            effort,
            _,
        ) = _JOINT_STATE.unpack(data)
        if (
            encapsulation,
            frame,
            slide,
            belt,
            position_count,
            velocity_count,
            effort_count,
        ) == _JOINT_STATE_CONSTANTS:
            return JointStateSample(
                sec * NANOSECONDS + nanosec,
                position,
                velocity,
                effort,
                belt_position,
                belt_velocity,
            )
    return _decode_joint_state(data)


def unpack_wrench(data: bytes) -> tuple[int, float]:
    """Read the stamp (ns) and `force.x` (N) out of a serialized geometry_msgs/msg/WrenchStamped.

    Any frame and byte order will do. Raises BagError for other bytes.
    """
    if len(data) == _WRENCH.size:
        encapsulation, sec, nanosec, frame, force = _WRENCH.unpack(data)
        if (encapsulation, frame) == _WRENCH_CONSTANTS:
            return sec * NANOSECONDS + nanosec, force
    message = _Decoder(data, "wrench")
    return message.header_stamp(), message.doubles(6)[0]


def unpack_header(data: bytes) -> int:
    """Read the stamp (ns) out of a serialized std_msgs/msg/Header, or a message that begins so.

    Raises BagError for other bytes.
    """
    if data[:4] == _LITTLE_ENDIAN and len(data) >= _STAMP.size:
        _, sec, nanosec = _STAMP.unpack_from(data)
        return sec * NANOSECONDS + nanosec
    return _Decoder(data, "header").header_stamp()


def joint_state_columns(messages: Sequence[bytes]) -> JointStateColumns:
    """Decode serialized joint states, all at once where they have the layout of `pack_joint_state`.

    Raises BagError at the first message that `unpack_joint_state` refuses.
    """
    table = _table(messages, _JOINT_STATE_TABLE, _JOINT_STATE_MASK, _JOINT_STATE_TEMPLATE)
    if table is None:
        stamps, *columns = zip(*map(unpack_joint_state, messages), strict=True)
        return JointStateColumns(
            np.array(stamps, np.int64), *(np.array(column, np.float64) for column in columns)
        )
    position, velocity, effort = table["position"], table["velocity"], table["effort"]
    return JointStateColumns(
        _stamps(table),
        position[:, 0].copy(),
        velocity[:, 0].copy(),
        effort[:, 0].copy(),
        position[:, 1].copy(),
        velocity[:, 1].copy(),
    )


def wrench_columns(messages: Sequence[bytes]) -> WrenchColumns:
    """Decode serialized wrenches, all at once where they have the layout of `pack_wrench`.

    Raises BagError at the first message that `unpack_wrench` refuses.
    """
    table = _table(messages, _WRENCH_TABLE, _WRENCH_MASK, _WRENCH_TEMPLATE)
    if table is None:
        stamps, forces = zip(*map(unpack_wrench, messages), strict=True)
        return WrenchColumns(np.array(stamps, np.int64), np.array(forces, np.float64))
    return WrenchColumns(_stamps(table), table["force"].copy())


def _words(data: bytes) -> NDArray[np.uint32]:
    return np.frombuffer(data, dtype="<u4")


# Packing ones where the layout has constants, zeros where it has values, leaves out the padding.
_JOINT_STATE_MASK = _words(
    _JOINT_STATE.pack(
        b"\xff" * 4, 0, 0, b"\xff" * 5, b"\xff" * 14, b"\xff" * 9, *[0xFFFFFFFF, 0.0, 0.0] * 3
    )
)
_JOINT_STATE_TEMPLATE = _words(pack_joint_state(0, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)))
_WRENCH_MASK = _words(_WRENCH.pack(b"\xff" * 4, 0, 0, b"\xff" * 10, 0.0))
_WRENCH_TEMPLATE = _words(pack_wrench(0, 0.0))


def _table(
    messages: Sequence[bytes],
    layout: np.dtype[np.void],
    mask: NDArray[np.uint32],
    template: NDArray[np.uint32],
) -> NDArray[np.void] | None:
    """View the messages as rows of the layout, or return None if one of them has another."""
    if not {layout.itemsize}.issuperset(map(len, messages)):
        return None
    data = b"".join(messages)
    if ((_words(data).reshape(len(messages), len(mask)) & mask) != template).any():
        return None
    return np.frombuffer(data, dtype=layout)


def _stamps(table: NDArray[np.void]) -> NDArray[np.int64]:
    return table["sec"].astype(np.int64) * NANOSECONDS + table["nanosec"]


def _unpackable(kind: str, stamp: int, error: struct.error) -> BagError:
    return BagError(
        f"a {kind} with the stamp {stamp} ns cannot be serialized ({error}); "
        "stamps are 32-bit seconds, values are numbers"
    )


def _decode_joint_state(data: bytes) -> JointStateSample:
    message = _Decoder(data, "joint state")
    stamp = message.header_stamp()
    names = [message.string() for _ in range(message.count())]
    position, velocity, effort = (message.doubles(message.count()) for _ in range(3))

    missing = [joint for joint in (SLIDE, BELT) if joint not in names]
    if missing:
        raise BagError(
            f"a joint state names the joints {names}; {' and '.join(missing)} must be among them"
        )
    lengths = len(position), len(velocity), len(effort) or len(names)
    if lengths != (len(names),) * 3:
        raise BagError(
            f"a joint state of the joints {names} has {len(position)} positions, "
            f"{len(velocity)} velocities and {len(effort)} efforts; "
            "one each is needed, of efforts one each or none"
        )
    slide, belt = names.index(SLIDE), names.index(BELT)
    return JointStateSample(
        stamp,
        position[slide],
        velocity[slide],
        effort[slide] if effort else math.nan,
        position[belt],
        velocity[belt],
    )


class _Decoder:
    """Reads one CDR message field by field; bytes behind the last field are left alone."""

    def __init__(self, data: bytes, kind: str) -> None:
        if data[:2] not in (b"\x00\x00", b"\x00\x01"):
            raise BagError(
                f"a {kind} message begins with the bytes '{data[:2].hex()}'; "
                "CDR begins with 0000 (big endian) or 0001 (little endian)"
            )
        self._body = data[4:]
        self._byte_order = "<" if data[1] else ">"
        self._offset = 0
        self._kind = kind

    def _advance(self, alignment: int, size: int) -> int:
        """Step over the next field and return where it starts."""
        start = -(-self._offset // alignment) * alignment
        if start + size > len(self._body):
            raise BagError(
                f"a {self._kind} message ends after {len(self._body)} bytes, "
                f"within a field of {size} bytes that starts at byte {start}"
            )
        self._offset = start + size
        return start

    def header_stamp(self) -> int:
        """Read a std_msgs/msg/Header and return its stamp in ns."""
        sec, nanosec = struct.unpack_from(
            f"{self._byte_order}iI", self._body, self._advance(alignment=4, size=8)
        )
        self.string()
        return sec * NANOSECONDS + nanosec

    def count(self) -> int:
        """Read an unsigned 32-bit number, the length of what follows."""
        (count,) = struct.unpack_from(
            f"{self._byte_order}I", self._body, self._advance(alignment=4, size=4)
        )
        return count

    def string(self) -> str:
        length = self.count()
        start = self._advance(alignment=1, size=length)
        return self._body[start : start + length].rstrip(b"\x00").decode(errors="replace")

    def doubles(self, count: int) -> tuple[float, ...]:
        if count == 0:
            return ()  # nothing follows an empty sequence, not even the padding
        start = self._advance(alignment=8, size=8 * count)
        return struct.unpack_from(f"{self._byte_order}{count}d", self._body, start)
