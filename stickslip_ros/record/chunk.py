"""Records of MCAP, and the content of a chunk of them: messages, as columns, and definitions.

A record is a head of opcode and length, then the fields that belong to the opcode.
"""

import struct
from array import array
from collections import deque
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from copy import copy
from io import BytesIO
from typing import Any, NamedTuple, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from numpy.typing import NDArray

from stickslip_ros.arrays import IntArray
from stickslip_ros.record.cdr import joined
from stickslip_ros.record.compression import ZSTD_MAGIC, unpack_message

ParsedT = TypeVar("ParsedT")

HEAD = struct.Struct("<BQ")
"""Opcode and length of the content."""
FIELDS: dict[int, tuple[int, ...]] = {
    Opcode.HEADER: (-4, -4),
    Opcode.FOOTER: (20,),
    Opcode.SCHEMA: (2, -4, -4, -4),
    Opcode.CHANNEL: (4, -4, -4, -4),
    Opcode.CHUNK: (28, -4, -8),
    Opcode.MESSAGE_INDEX: (2, -4),
    Opcode.CHUNK_INDEX: (32, -4, 8, -4, 16),
    Opcode.ATTACHMENT: (16, -4, -4, -8, 4),
    Opcode.ATTACHMENT_INDEX: (40, -4, -4),
    Opcode.STATISTICS: (42, -4),
    Opcode.METADATA: (-4, -4),
    Opcode.METADATA_INDEX: (16, -4),
    Opcode.SUMMARY_OFFSET: (17,),
    Opcode.DATA_END: (4,),
}
"""The fields of a record: a size in bytes or, if negative, the bytes of a size prefix."""
_MESSAGE = np.dtype("u1, <u8, <u2, <u4, <u8, <u8")
_MESSAGE.names = "opcode", "length", "channel", "sequence", "log_time", "publish_time"
"""The fields of a message record before the message itself."""
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


def parse(read: Callable[[ReadDataStream], ParsedT], content: bytes) -> ParsedT:
    """Parse a content with the mcap library; raise DamageError if it fails."""
    try:
        return read(ReadDataStream(BytesIO(content)))
    except (EndOfFile, struct.error, UnicodeDecodeError, OverflowError, ValueError) as error:
        raise DamageError from error


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
        lengths = self._field("length").astype(np.int64)
        self.end = self.begin + (lengths - MESSAGE_LENGTH)
        sound = (self._field("opcode") == Opcode.MESSAGE) & (lengths >= MESSAGE_LENGTH)
        if not (sound & (lengths <= len(data)) & (self.end <= len(data))).all():
            raise DamageError

    def __len__(self) -> int:
        return len(self.begin)

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
        """Log times, ns."""
        return self._field("log_time").astype(np.int64)

    @property
    def publish_time(self) -> IntArray:
        """Publish times, ns."""
        return self._field("publish_time").astype(np.int64)

    def on(self, channels: Collection[int]) -> "MessageBlock":
        """Return the messages on these channels."""
        chosen = np.zeros(1 << 16, bool)
        chosen[list(channels)] = True
        wanted = chosen[self.channel]
        if wanted.all():
            return self
        part = copy(self)
        part.begin, part.end = self.begin[wanted], self.end[wanted]
        return part

    def unpacked(self) -> Iterator["MessageBlock"]:
        """Yield the messages; if rosbag2 compressed each one, unpacked and in smaller blocks."""
        if len(self) == 0 or not self.data.startswith(ZSTD_MAGIC, int(self.begin[0])):
            yield self
            return
        records: list[bytes] = []
        size = 0
        for begin, end in zip(self.begin.tolist(), self.end.tolist(), strict=True):
            message = unpack_message(self.data[begin:end])
            head = HEAD.pack(Opcode.MESSAGE, MESSAGE_LENGTH + len(message))
            records.append(head + self.data[begin - MESSAGE_LENGTH : begin] + message)
            size += len(records[-1])
            if size > WINDOW:
                yield as_block(records)
                records, size = [], 0
        if records:
            yield as_block(records)

    def _field(self, name: str) -> NDArray[Any]:
        count = max(0, len(self.data) - MESSAGE_SIZE + 1)
        records = np.ndarray((count,), _MESSAGE, self.data, strides=(1,))  # one at each byte
        return records[name][self.begin - MESSAGE_SIZE]


class OpenChunk(NamedTuple):
    """The content of a chunk."""

    messages: MessageBlock
    others_end: int
    """The data of the messages may hold other records up to this byte."""

    @property
    def definitions(self) -> Iterator[tuple[int, bytes]]:
        """Opcode and content of each definition in the chunk."""
        data = self.messages.data
        for opcode, begin, end in records_in(data[: self.others_end]):
            if opcode in DEFINITIONS:
                yield opcode, data[begin : min(end, begin + LARGEST_TABLE)]


def as_block(records: list[bytes]) -> MessageBlock:
    """Return message records as a block."""
    data, starts, _ = joined(records)
    return MessageBlock(data, starts)


def open_chunk(data: bytes, starts: IntArray) -> OpenChunk:
    """Return the content of a chunk; `starts` is where its messages start, from its indexes.

    If the indexes are wrong, the records are read one after another. Raises DamageError if the
    data do not consist of records.
    """
    if len(starts) > 0:
        with suppress(DamageError):
            chunk = OpenChunk(MessageBlock(data, starts), int(starts[0]))
            deque(chunk.definitions, maxlen=0)  # raises if one of them is damaged
            end = chunk.messages.end
            if np.array_equal(end[:-1], starts[1:]) and end[-1] == len(data):
                return chunk
    messages = (begin for opcode, begin, _ in records_in(data) if opcode == Opcode.MESSAGE)
    starts = np.array(array("q", messages), np.int64) - HEAD.size
    return OpenChunk(MessageBlock(data, starts), len(data))
