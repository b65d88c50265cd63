"""Decode CDR, the byte layout of ROS messages: single messages by field, blocks as tables.

CDR aligns every number to its own size, counted from the end of a four-byte encapsulation header.
Messages that differ only in their values have them at the same places, so that a block of such
messages is a table. Padding is ignored: Fast DDS leaves arbitrary memory in it and after the last
field.
"""

import itertools
import math
import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.errors import MessageError
from stickslip_ros.stamps import NANOSECONDS

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""The encapsulation header that this package writes."""

_ENCAPSULATION = len(LITTLE_ENDIAN)

_STRUCTURES = 8
"""Number of different structures that a block of messages is searched for."""


class Refused(NamedTuple):
    """Messages that could not be read."""

    number: int
    reason: str
    """Why the first one could not be read; empty if there is none."""

    def followed_by(self, later: "Refused") -> "Refused":
        """Return these messages and later ones."""
        return Refused(self.number + later.number, self.reason or later.reason)


class Messages(NamedTuple):
    """Serialized messages: `data[begin[i] : end[i]]`."""

    data: bytes
    begin: IntArray
    end: IntArray


def joined(messages: Sequence[bytes]) -> Messages:
    """Return single messages joined together."""
    size = np.array([len(message) for message in messages], np.int64)
    end = np.cumsum(size)
    return Messages(b"".join(messages), end - size, end)


class Decoder:
    """Find the fields of one CDR message; bytes after the last field are ignored."""

    def __init__(self, data: bytes, kind: str) -> None:
        if data[:2] not in (b"\x00\x00", b"\x00\x01"):
            raise MessageError(
                f"a {kind} message starts with the bytes '{data[:2].hex()}'; "
                "CDR starts with 0000 (big endian) or 0001 (little endian)"
            )
        self.data = data
        self.byte_order = "<" if data[1] else ">"
        self.structure = [slice(0, 2)]
        """The parts found so far that are neither values nor padding."""
        self._place = _ENCAPSULATION
        self._kind = kind

    def header_stamp(self) -> int:
        """Skip a std_msgs/msg/Header and return where its stamp is."""
        stamp = self._advance(alignment=4, size=8)
        self.string()
        return stamp

    def count(self) -> int:
        """Read an unsigned 32-bit number, the length of the next field."""
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
        """Skip `count` numbers; return where they are, and their count."""
        if count == 0:
            return 0, 0  # an empty sequence has no padding either
        return self._advance(alignment=8, size=8 * count), count

    def skip_duration(self) -> None:
        """Skip a builtin_interfaces/msg/Duration."""
        self._advance(alignment=4, size=8)

    def _advance(self, alignment: int, size: int) -> int:
        offset = -(-(self._place - _ENCAPSULATION) // alignment) * alignment
        start = _ENCAPSULATION + offset
        if start + size > len(self.data):
            raise MessageError(
                f"a {self._kind} message ends after {len(self.data) - _ENCAPSULATION} bytes, "
                f"within a field of {size} bytes that starts at byte {offset}"
            )
        self._place = start + size
        return start


class Layout:
    """The places of the values in one message, and in all messages of the same structure."""

    def __init__(self, message: Decoder, stamp: int | None, values: Sequence[int | None]) -> None:
        """Take the places of the stamp and of the values, None for what is missing.

        A missing stamp is 0.
        """
        order = message.byte_order
        fields = {str(n): ("f8", place) for n, place in enumerate(values) if place is not None}
        if stamp is not None:
            fields |= {"sec": ("i4", stamp), "nanosec": ("u4", stamp + 4)}
        self._table = np.dtype(
            {
                "names": [*fields],
                "formats": [order + form for form, _ in fields.values()],
                "offsets": [place for _, place in fields.values()],
                "itemsize": len(message.data),
            }
        )
        self._fields, self._count = fields, len(values)
        self._mask = np.zeros(len(message.data), np.uint8)
        for stretch in message.structure:
            self._mask[stretch] = 0xFF
        self._structure = np.frombuffer(message.data, np.uint8) & self._mask

    @property
    def size(self) -> int:
        """Size of a message, bytes."""
        return len(self._mask)

    def fits(self, messages: NDArray[np.void]) -> BoolArray:
        """Return which messages of this size have this structure."""
        content = messages.view(np.uint8).reshape(len(messages), self.size)
        same = (content & self._mask) == self._structure
        return np.ones(len(messages), bool) if same.all() else same.all(axis=1)

    def table(self, messages: NDArray[np.void]) -> tuple[IntArray, FloatArray]:
        """Return stamps (ns) of shape (messages,) and values of shape (values, messages)."""
        table = messages.view(self._table)
        values = np.full((self._count, len(table)), math.nan)
        for number, row in enumerate(values):
            if str(number) in self._fields:
                row[:] = table[str(number)]
        if "sec" not in self._fields:
            return np.zeros(len(table), np.int64), values
        return table["sec"].astype(np.int64) * NANOSECONDS + table["nanosec"], values

    def read(self, message: bytes) -> tuple[int, list[float]]:
        """Return stamp (ns) and values of the message from which the layout was taken."""
        stamp, values = self.table(np.frombuffer(message, self._table))
        return int(stamp[0]), values[:, 0].tolist()


def decode(
    data: bytes,
    begin: IntArray,
    end: IntArray,
    layout_of: Callable[[bytes], Layout],
    value_count: int,
) -> tuple[IntArray, IntArray, FloatArray, Refused]:
    """Return which messages are readable, in order, their stamps and values, and the refused."""
    parts = [(np.empty(0, np.intp), np.empty(0, np.int64), np.empty((value_count, 0)))]
    refused = Refused(0, "")
    left = np.arange(len(begin))
    for attempt in itertools.count():
        if len(left) == 0:
            break
        try:
            layout = layout_of(data[begin[left[0]] : end[left[0]]])
        except MessageError as error:
            refused = refused.followed_by(Refused(1, str(error)))
            left = left[1:]
            continue
        # If every message has its own structure, comparing all of them would take too long.
        compared = left if attempt < _STRUCTURES else left[:1]
        taken = end[compared] - begin[compared] == layout.size
        shape, item = (max(0, len(data) - layout.size + 1),), np.dtype((np.void, layout.size))
        stretches = np.ndarray(shape, item, data, strides=(1,))  # one from each byte on
        messages = stretches[begin[compared[taken]]]
        fits = layout.fits(messages)
        taken[taken] = fits
        parts.append((compared[taken], *layout.table(messages if fits.all() else messages[fits])))
        left = compared[~taken] if attempt < _STRUCTURES else left[1:]
    if len(parts) == 2:
        return *parts[1], refused
    places, stamps, values = zip(*parts, strict=True)
    rows = np.concatenate(places)
    order = np.argsort(rows)
    values = np.concatenate(values, axis=1)[:, order]
    return rows[order], np.concatenate(stamps)[order], values, refused
