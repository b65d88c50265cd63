"""Messages of an MCAP file as columns: those of a chunk, and single ones joined to a block.

A record is a head of opcode and length, then the fields that belong to the opcode.
"""

import struct
from array import array
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from stickslip_ros.arrays import IntArray
from stickslip_ros.record.cdr import Messages, joined
from stickslip_ros.record.compression import ZSTD_MAGIC, unpack_message

HEAD = struct.Struct("<BQ")
"""Opcode and length of the content."""
_MESSAGE = np.dtype("u1, <i8, <u2, <u4, <i8, <i8")
_MESSAGE.names = "opcode", "length", "channel", "sequence", "log_time", "publish_time"
"""The fields of a message record before the message itself; a length above 2^63 is negative."""
MESSAGE_SIZE = _MESSAGE.itemsize
MESSAGE_LENGTH = MESSAGE_SIZE - HEAD.size
"""Bytes of the content of a message record, without the message."""
WINDOW = 1 << 20
"""Bytes after which a block of messages that are read, or unpacked, one by one is yielded."""

DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
"""Records that define the messages."""
LARGEST_TABLE = 16 << 20
"""Bytes of the largest record of texts that is parsed: parsing takes many times its size."""


class DamageError(Exception):
    """A record is damaged; used by the modules of bags only."""


def records_in(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, and begin and end of the content, of each record in the data.

    Raises DamageError where the data are not a record.
    """
    position = 0
    while position < len(data):
        try:
            opcode, length = HEAD.unpack_from(data, position)
        except struct.error as error:
            raise DamageError from error
        begin = position + HEAD.size
        position = begin + length
        if opcode == 0 or position > len(data):
            raise DamageError
        yield opcode, begin, position


class MessageBlock:
    """Adjacent messages of a file, such as those of one chunk: arrays of shape (n,).

    The serialized message i is `data[begin[i] : end[i]]`.
    """

    def __init__(self, data: bytes, starts: IntArray) -> None:
        """Take the message records at `starts`; raise DamageError if one of them is no message."""
        if len(starts) > 0 and not 0 <= starts.min() <= starts.max() <= len(data) - MESSAGE_SIZE:
            raise DamageError
        self.data = data
        self.begin = starts + MESSAGE_SIZE
        lengths = self._field("length")
        sound = (self._field("opcode") == Opcode.MESSAGE) & (lengths >= MESSAGE_LENGTH)
        if not (sound & (lengths <= len(data) - HEAD.size - starts)).all():
            raise DamageError
        self.end: IntArray = starts + HEAD.size + lengths

    def __len__(self) -> int:
        return len(self.begin)

    @property
    def messages(self) -> Messages:
        """The serialized messages."""
        return Messages(self.data, self.begin, self.end)

    @property
    def channel(self) -> NDArray[np.uint16]:
        """Channel ids."""
        return self._field("channel")

    @property
    def sequence(self) -> NDArray[np.uint32]:
        """Sequence numbers of the recorder; zero if it assigned none."""
        return self._field("sequence")

    @property
    def log_time(self) -> IntArray:
        """Log times, ns; negative above 63 bits."""
        return self._field("log_time")

    @property
    def publish_time(self) -> IntArray:
        """Publish times, ns; negative above 63 bits."""
        return self._field("publish_time")

    def on_channels(self, channels: Collection[int]) -> "MessageBlock":
        """Return the messages on these channels."""
        chosen = np.zeros(1 << 16, np.bool_)
        chosen[list(channels)] = True
        wanted = chosen[self.channel]
        return self if wanted.all() else MessageBlock(self.data, self.begin[wanted] - MESSAGE_SIZE)

    def unpacked(self) -> Iterator["MessageBlock"]:
        """Yield the messages; if rosbag2 compressed each one, unpacked and in smaller blocks."""
        if len(self) > 0 and self.data.startswith(ZSTD_MAGIC, int(self.begin[0])):
            yield from as_blocks(self._unpacked_records())
        else:
            yield self

    def _unpacked_records(self) -> Iterator[bytes]:
        for begin, end in zip(self.begin.tolist(), self.end.tolist(), strict=True):
            message = unpack_message(self.data[begin:end])
            head = HEAD.pack(Opcode.MESSAGE, MESSAGE_LENGTH + len(message))
            yield head + self.data[begin - MESSAGE_LENGTH : begin] + message

    def _field(self, name: str) -> NDArray[Any]:
        count = max(0, len(self.data) - MESSAGE_SIZE + 1)
        records = np.ndarray((count,), _MESSAGE, self.data, strides=(1,))  # one at each byte
        return records[name][self.begin - MESSAGE_SIZE]


def as_blocks(records: Iterable[bytes]) -> Iterator[MessageBlock]:
    """Yield message records as blocks that are not much larger than a window."""
    gathered: list[bytes] = []
    size = 0
    for record in records:
        gathered.append(record)
        size += len(record)
        if size > WINDOW:
            yield _block_of(gathered)
            gathered, size = [], 0
    if gathered:
        yield _block_of(gathered)


def _block_of(records: list[bytes]) -> MessageBlock:
    data, starts, _ = joined(records)
    return MessageBlock(data, starts)


class OpenChunk(NamedTuple):
    """The content of a chunk."""

    messages: MessageBlock
    others_end: int
    """The data of the messages may hold other records up to this byte."""

    @property
    def definitions(self) -> Iterator[tuple[int, bytes]]:
        """Opcode and content, up to the largest that is parsed, of each definition."""
        data = self.messages.data
        for opcode, begin, end in records_in(data[: self.others_end]):
            if opcode in DEFINITIONS:
                yield opcode, data[begin : min(end, begin + LARGEST_TABLE)]


def open_chunk(data: bytes, starts: IntArray) -> OpenChunk:
    """Return the content of a chunk; `starts` is where its messages start, from its indexes.

    If the indexes are wrong, the records are read one after another. Raises DamageError if the
    data do not consist of records.
    """
    if len(starts) > 0:
        with suppress(DamageError):
            messages, first = MessageBlock(data, starts), int(starts[0])
            end = messages.end
            adjacent = np.array_equal(end[:-1], starts[1:]) and end[-1] == len(data)
            if adjacent and all(
                opcode != Opcode.MESSAGE for opcode, *_ in records_in(data[:first])
            ):
                return OpenChunk(messages, first)
    begins = (begin for opcode, begin, _ in records_in(data) if opcode == Opcode.MESSAGE)
    starts = np.array(array("q", begins), np.int64) - HEAD.size
    return OpenChunk(MessageBlock(data, starts), len(data))
