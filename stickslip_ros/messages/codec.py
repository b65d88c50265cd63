"""The byte layout (CDR) of the messages that go round the control loop and into the bag.

CDR aligns every number to its own size, counted from behind a four-byte encapsulation header. With
fixed joints and a fixed frame all messages have one length, so that each is packed and unpacked in
one step. Messages laid out otherwise, as other publishers may send them, are decoded field by
field; where one of them has its values, all have them that are equal but for the values, so that a
block of messages is a table. Padding is never looked at: Fast DDS leaves in it, and behind the last
field, whatever was in memory.
"""

import itertools
import math
import reprlib
import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.errors import BagError
from stickslip_ros.samples import ForceColumns, Sample, SampleColumns
from stickslip_ros.stamps import NANOSECONDS

SLIDE = "slide"
BELT = "belt"

_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_ENCAPSULATION = len(_LITTLE_ENDIAN)

_JOINT_STATE_VALUES = 5
_WRENCH_VALUES = 1
_MOST_JOINTS = 1000
"""More are not looked through: that might take longer than the message stands for."""
_STRUCTURES = 8
"""Different structures that are looked for in a block of messages."""


class Refused(NamedTuple):
    """Messages that could not be read."""

    number: int
    reason: str
    """Why the first could not; empty where there is none."""


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
# The components of the wrench other than force.x are zero when packed and skipped when unpacked.
_WRENCH = struct.Struct("<4s iI 10s6x d40x")
_WRENCH_FRAME = _name(SLIDE)
_WRENCH_CONSTANTS = (_LITTLE_ENDIAN, _WRENCH_FRAME)
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


def unpack_joint_state(data: bytes) -> Sample:
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
            return Sample(
                sec * NANOSECONDS + nanosec,
                position,
                velocity,
                effort,
                belt_position,
                belt_velocity,
            )
    stamp, values = _joint_state_layout(data).read(data)
    return Sample(stamp, *values)


def unpack_wrench(data: bytes) -> tuple[int, float]:
    """Read the stamp (ns) and `force.x` (N) out of a serialized geometry_msgs/msg/WrenchStamped.

    Any frame and byte order will do. Raises BagError for other bytes.
    """
    if len(data) == _WRENCH.size:
        encapsulation, sec, nanosec, frame, force = _WRENCH.unpack(data)
        if (encapsulation, frame) == _WRENCH_CONSTANTS:
            return sec * NANOSECONDS + nanosec, force
    stamp, (force,) = _wrench_layout(data).read(data)
    return stamp, force


def unpack_header(data: bytes) -> int:
    """Read the stamp (ns) out of a serialized std_msgs/msg/Header, or a message that begins so.

    Raises BagError for other bytes.
    """
    if data[:4] == _LITTLE_ENDIAN and len(data) >= _STAMP.size:
        _, sec, nanosec = _STAMP.unpack_from(data)
        return sec * NANOSECONDS + nanosec
    return _header_layout(data).read(data)[0]


def joint_state_columns(messages: Sequence[bytes]) -> tuple[SampleColumns, Refused]:
    """Decode serialized joint states; say which `unpack_joint_state` would refuse."""
    return joint_states_in(*joined(messages))


def joint_states_in(data: bytes, begin: IntArray, end: IntArray) -> tuple[SampleColumns, Refused]:
    """Decode the serialized joint states `data[begin[i] : end[i]]`, as `joint_state_columns`."""
    stamp, values, refused = _decode(data, begin, end, _joint_state_layout, _JOINT_STATE_VALUES)
    return SampleColumns(stamp, *values), refused


def wrench_columns(messages: Sequence[bytes]) -> tuple[ForceColumns, Refused]:
    """Decode serialized wrenches; say which `unpack_wrench` would refuse."""
    return wrenches_in(*joined(messages))


def wrenches_in(data: bytes, begin: IntArray, end: IntArray) -> tuple[ForceColumns, Refused]:
    """Decode the serialized wrenches `data[begin[i] : end[i]]`, as `wrench_columns`."""
    stamp, values, refused = _decode(data, begin, end, _wrench_layout, _WRENCH_VALUES)
    return ForceColumns(stamp, *values), refused


def rows(data: bytes, starts: IntArray, size: int) -> NDArray[np.void]:
    """Return the stretches of `size` bytes that begin there as items of an array, copied."""
    stretches = np.ndarray(
        (max(0, len(data) - size + 1),), np.dtype((np.void, size)), data, strides=(1,)
    )
    return stretches[starts]


def joined(messages: Sequence[bytes]) -> tuple[bytes, IntArray, IntArray]:
    """Return messages as one, and where each of them begins and ends in it."""
    size = np.array([len(message) for message in messages], np.int64)
    end = np.cumsum(size)
    return b"".join(messages), end - size, end


class _Layout:
    """Where the values of one message stand, and of all that have its structure."""

    def __init__(self, message: "_Decoder", stamp: int, values: Sequence[int | None]) -> None:
        """Take the places of the stamp and of the values, None for one that is not there."""
        order = message.byte_order
        places = {str(name): place for name, place in enumerate(values) if place is not None}
        self._table = np.dtype(
            {
                "names": ["sec", "nanosec", *places],
                "formats": [f"{order}i4", f"{order}u4", *[f"{order}f8"] * len(places)],
                "offsets": [stamp, stamp + 4, *places.values()],
                "itemsize": len(message.data),
            }
        )
        self._values = [str(name) if str(name) in places else None for name in range(len(values))]
        self._mask = np.zeros(len(message.data), np.uint8)
        for stretch in message.structure:
            self._mask[stretch] = 0xFF
        self._structure = np.frombuffer(message.data, np.uint8) & self._mask

    @property
    def size(self) -> int:
        """Of a message, in bytes."""
        return len(self._mask)

    def fits(self, messages: NDArray[np.void]) -> BoolArray:
        """Return which messages of this size have this structure."""
        content = messages.view(np.uint8).reshape(len(messages), self.size)
        same = (content & self._mask) == self._structure
        return np.ones(len(messages), bool) if same.all() else same.all(axis=1)

    def table(self, messages: NDArray[np.void]) -> tuple[IntArray, FloatArray]:
        """Return stamps (ns) of shape (messages,) and values of shape (values, messages)."""
        table = messages.view(self._table)
        values = np.full((len(self._values), len(table)), math.nan)
        for row, name in zip(values, self._values, strict=True):
            if name is not None:
                row[:] = table[name]
        return table["sec"].astype(np.int64) * NANOSECONDS + table["nanosec"], values

    def read(self, message: bytes) -> tuple[int, list[float]]:
        """Return stamp (ns) and values of the message that the layout was taken from."""
        stamp, values = self.table(np.frombuffer(message, self._table))
        return int(stamp[0]), values[:, 0].tolist()


def _decode(
    data: bytes,
    begin: IntArray,
    end: IntArray,
    layout_of: Callable[[bytes], _Layout],
    value_count: int,
) -> tuple[IntArray, FloatArray, Refused]:
    """Return stamps and values of the messages that can be read, in their order, and the rest."""
    parts = [(np.empty(0, np.intp), np.empty(0, np.int64), np.empty((value_count, 0)))]
    refused = Refused(0, "")
    left = np.arange(len(begin))
    for attempt in itertools.count():
        if len(left) == 0:
            break
        try:
            layout = layout_of(data[begin[left[0]] : end[left[0]]])
        except BagError as error:
            refused = Refused(refused.number + 1, refused.reason or str(error))
            left = left[1:]
            continue
        # Where every message has a structure of its own, to compare them all would take for ever.
        compared = left if attempt < _STRUCTURES else left[:1]
        taken = end[compared] - begin[compared] == layout.size
        messages = rows(data, begin[compared[taken]], layout.size)
        fits = layout.fits(messages)
        taken[taken] = fits
        parts.append((compared[taken], *layout.table(messages if fits.all() else messages[fits])))
        left = compared[~taken] if attempt < _STRUCTURES else left[1:]
    if len(parts) == 2:
        return *parts[1][1:], refused
    places, stamps, values = zip(*parts, strict=True)
    order = np.argsort(np.concatenate(places))
    return np.concatenate(stamps)[order], np.concatenate(values, axis=1)[:, order], refused


def _unpackable(kind: str, stamp: int, error: struct.error) -> BagError:
    return BagError(
        f"a {kind} with the stamp {stamp} ns cannot be serialized ({error}); "
        "stamps are 32-bit seconds, values are numbers"
    )


def _joint_state_layout(data: bytes) -> _Layout:
    message = _Decoder(data, "joint state")
    stamp = message.header_stamp()
    joints = message.count()
    if joints > _MOST_JOINTS:
        raise BagError(f"a joint state of {joints} joints; at most {_MOST_JOINTS} are taken")
    names = [message.string() for _ in range(joints)]
    shown = reprlib.repr(names)
    (position, positions), (velocity, velocities), (effort, efforts) = (
        message.doubles(message.count()) for _ in range(3)
    )
    missing = [joint for joint in (SLIDE, BELT) if joint not in names]
    if missing:
        raise BagError(
            f"a joint state names the joints {shown}; {' and '.join(missing)} must be among them"
        )
    if (positions, velocities, efforts or len(names)) != (len(names),) * 3:
        raise BagError(
            f"a joint state of the joints {shown} has {positions} positions, {velocities} "
            f"velocities and {efforts} efforts; one each is needed, of efforts one each or none"
        )
    slide, belt = 8 * names.index(SLIDE), 8 * names.index(BELT)
    return _Layout(
        message,
        stamp,
        [
            position + slide,
            velocity + slide,
            effort + slide if efforts else None,
            position + belt,
            velocity + belt,
        ],
    )


def _wrench_layout(data: bytes) -> _Layout:
    message = _Decoder(data, "wrench")
    stamp = message.header_stamp()
    force, _ = message.doubles(6)
    return _Layout(message, stamp, [force])


def _header_layout(data: bytes) -> _Layout:
    message = _Decoder(data, "header")
    return _Layout(message, message.header_stamp(), [])


class _Decoder:
    """Finds the fields of one CDR message; bytes behind the last field are left alone."""

    def __init__(self, data: bytes, kind: str) -> None:
        if data[:2] not in (b"\x00\x00", b"\x00\x01"):
            raise BagError(
                f"a {kind} message begins with the bytes '{data[:2].hex()}'; "
                "CDR begins with 0000 (big endian) or 0001 (little endian)"
            )
        self.data = data
        self.byte_order = "<" if data[1] else ">"
        self.structure = [slice(0, 2)]
        """What is no value and no padding so far."""
        self._place = _ENCAPSULATION
        self._kind = kind

    def header_stamp(self) -> int:
        """Step over a std_msgs/msg/Header and return where its stamp is."""
        stamp = self._advance(alignment=4, size=8)
        self.string()
        return stamp

    def count(self) -> int:
        """Read an unsigned 32-bit number, the length of what follows."""
        start = self._advance(alignment=4, size=4)
        self.structure.append(slice(start, start + 4))
        (count,) = struct.unpack_from(f"{self.byte_order}I", self.data, start)
        return count

    def string(self) -> str:
        """Read a string."""
        length = self.count()
        start = self._advance(alignment=1, size=length)
        self.structure.append(slice(start, start + length))
        return self.data[start : start + length].rstrip(b"\x00").decode(errors="replace")

    def doubles(self, count: int) -> tuple[int, int]:
        """Step over so many numbers; return where they are, and how many."""
        if count == 0:
            return 0, 0  # nothing follows an empty sequence, not even the padding
        return self._advance(alignment=8, size=8 * count), count

    def _advance(self, alignment: int, size: int) -> int:
        """Step over the next field and return where it starts."""
        offset = -(-(self._place - _ENCAPSULATION) // alignment) * alignment
        start = _ENCAPSULATION + offset
        if start + size > len(self.data):
            raise BagError(
                f"a {self._kind} message ends after {len(self.data) - _ENCAPSULATION} bytes, "
                f"within a field of {size} bytes that starts at byte {offset}"
            )
        self._place = start + size
        return start
