"""One MCAP file, read as far as it goes: what a killed recorder leaves, or a disk has damaged.

The mcap library parses the records. Going from record to record is done here: the library fails
where a file is cut off or damaged, and takes messages apart one by one. A record counts as sound
if its fields fill it exactly, and a chunk if its checksum is right as well; behind anything else
the reading goes on at the next sound chunk.
"""

import re
import struct
import zlib
from array import array
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator
from copy import copy
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    Footer,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from stickslip_ros.arrays import IntArray
from stickslip_ros.bags.compression import LARGEST, ZSTD_MAGIC, unpack, unpack_message
from stickslip_ros.errors import BagError
from stickslip_ros.messages.cdr import joined

_HEAD = struct.Struct("<BQ")
_MESSAGE_FIELDS = {
    "opcode": ("u1", 0),
    "length": ("<u8", 1),
    "channel": ("<u2", 9),
    "sequence": ("<u4", 11),
    "log_time": ("<u8", 15),
    "publish_time": ("<u8", 23),
}
"""Type of each field of a message record, and where it stands."""
_MESSAGE_SIZE = 31
_MESSAGE_LENGTH = _MESSAGE_SIZE - _HEAD.size
"""Of a message record's content, without the message."""
_INDEX_HEAD = 6
"""Bytes of a message index before its pairs of log time and offset."""
_INDEX_ENTRY = 16
_ATTACHMENT_TIMES = 16
"""Bytes of an attachment before its name."""
_FOOTER_LENGTH = 20
_FOOTER_CHECKED = 16
_DATA_END = _HEAD.pack(Opcode.DATA_END, 4)

# The fields of a record: so many bytes or, where negative, what its own size of so many precedes.
_FIELDS: dict[int, tuple[int, ...]] = {
    Opcode.HEADER: (-4, -4),
    Opcode.FOOTER: (_FOOTER_LENGTH,),
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
_OPCODES = frozenset((*_FIELDS, Opcode.MESSAGE))
_PRIVATE = 0x80
"""Opcodes from here on mean what a program likes."""
_INVENTORY = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA, Opcode.ATTACHMENT))
"""What stands between the messages and tells what they are or how they came about."""
_LARGEST_TABLE = 16 << 20
"""Bytes of the largest record of texts that is taken apart: that takes many times its size."""
_MOST_NOTED = 32 << 20
_NOTE = 200
"""Bytes of memory for all that is noted of a file's inventory, and what a note takes itself."""
_MOST_GAPS_TOLD = 20
_CHECKED = 1_000_000
"""Weight of a definition with a checksum against those without."""

_CHUNK_HEAD = re.compile(
    rb"\x06.{5}\0\0\0.{28}(?:\0\0\0\0|\x03\0\0\0lz4|\x04\0\0\0zstd)", re.DOTALL
)
_CHUNK_HEAD_SIZE = 9 + 28 + 8
_WINDOW = 1 << 20

_Parsed = TypeVar("_Parsed")
_Place = tuple[int, int, int]
"""Opcode of a record; begin and end of its content."""


class _DamageError(Exception):
    """A record is not what it says."""


class MessageBlock:
    """Messages that stand together in a file, such as those of one chunk: arrays of shape (n,).

    The serialized message i is `data[begin[i] : end[i]]`.
    """

    def __init__(self, data: bytes, starts: IntArray) -> None:
        """Take the message records that start there; raises _DamageError where there is none."""
        if len(starts) > 0 and not 0 <= starts.min() <= starts.max() <= len(data) - _MESSAGE_SIZE:
            raise _DamageError
        self.data = data
        self.begin = starts + _MESSAGE_SIZE
        lengths = self._field("length").astype(np.int64)
        self.end = self.begin + (lengths - _MESSAGE_LENGTH)
        sound = (self._field("opcode") == Opcode.MESSAGE) & (lengths >= _MESSAGE_LENGTH)
        if not (sound & (lengths <= len(data)) & (self.end <= len(data))).all():
            raise _DamageError

    def __len__(self) -> int:
        return len(self.begin)

    @property
    def channel(self) -> NDArray[np.uint16]:
        """Ids of the channels."""
        return self._field("channel")

    @property
    def sequence(self) -> NDArray[np.uint32]:
        """Numbers given by the recorder; zero where it gave none."""
        return self._field("sequence")

    @property
    def log_time(self) -> IntArray:
        """In ns."""
        return self._field("log_time").astype(np.int64)

    @property
    def publish_time(self) -> IntArray:
        """In ns."""
        return self._field("publish_time").astype(np.int64)

    def on(self, channels: Collection[int]) -> "MessageBlock":
        """Return those on these channels."""
        chosen = np.zeros(1 << 16, bool)
        chosen[list(channels)] = True
        wanted = chosen[self.channel]
        if wanted.all():
            return self
        part = copy(self)
        part.begin, part.end = self.begin[wanted], self.end[wanted]
        return part

    def unpacked(self) -> Iterator["MessageBlock"]:
        """Yield them, unpacked and in smaller blocks if rosbag2 packed each message by itself."""
        if len(self) == 0 or not self.data.startswith(ZSTD_MAGIC, int(self.begin[0])):
            yield self
            return
        records: list[bytes] = []
        size = 0
        for begin, end in zip(self.begin.tolist(), self.end.tolist(), strict=True):
            message = unpack_message(self.data[begin:end])
            head = _HEAD.pack(Opcode.MESSAGE, _MESSAGE_LENGTH + len(message))
            records.append(head + self.data[begin - _MESSAGE_LENGTH : begin] + message)
            size += len(records[-1])
            if size > _WINDOW:
                yield _as_block(records)
                records, size = [], 0
        if records:
            yield _as_block(records)

    def _field(self, name: str) -> NDArray[Any]:
        """Return a field of the records' heads."""
        kind, place = _MESSAGE_FIELDS[name]
        count = len(self.data) - np.dtype(kind).itemsize + 1
        values = np.ndarray((max(0, count),), kind, self.data, strides=(1,))
        return values[self.begin - (_MESSAGE_SIZE - place)]


class _Record(NamedTuple):
    """A sound record of the file."""

    start: int
    opcode: int
    length: int
    """Of its content."""

    @property
    def content(self) -> int:
        return self.start + _HEAD.size

    @property
    def end(self) -> int:
        return self.content + self.length


class _OpenChunk(NamedTuple):
    """What is in a chunk."""

    messages: MessageBlock
    others_end: int
    """Up to there the data of the messages may hold other records."""

    @property
    def others(self) -> Iterator[_Place]:
        """Its records that tell what the messages are or how they came about."""
        records = _records_in(self.messages.data[: self.others_end])
        return (record for record in records if record[0] in _INVENTORY)


class McapFile:
    """An MCAP file that is open for reading."""

    def __init__(self, path: Path) -> None:
        """Open the file; raises BagError if that is impossible or it is not MCAP."""
        self.path = path
        self.schemas: dict[int, Schema] = {}
        """By id."""
        self.channels: dict[int, Channel] = {}
        """By id."""
        self.statistics: Statistics | None = None
        """The file's own account of its messages, if it has one."""
        self._definitions: Counter[tuple[int, int, bytes]] = Counter()
        self._channel_ids: set[int] = set()
        self._tables: dict[int, str] = {}
        self._attachments: dict[int, str] = {}
        self._noted = 0
        self._chunked = False
        self._gaps: dict[int, int] = {}
        self._lost: dict[int, int] = {}
        if path.exists() and not path.is_file():
            raise BagError(f"the file {path} cannot be opened: it is no regular file")
        try:
            self._stream = path.open("rb")
        except OSError as error:
            raise BagError(f"the file {path} cannot be opened: {error.strerror}") from error
        try:
            self._size = self._stream.seek(0, 2)
            self._whole = self._read_inventory()
        except BaseException:
            self._stream.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    @property
    def damage(self) -> list[str]:
        """What is known to be missing from the file, in sentences; reading may find more."""
        name = self.path.name
        gaps = self._merged_gaps()
        found = [
            f"{name}: bytes {start} to {end - 1} of {self._size} cannot be read"
            for start, end in gaps[:_MOST_GAPS_TOLD]
        ]
        if len(gaps) > _MOST_GAPS_TOLD:
            found.append(f"{name}: nor can {len(gaps) - _MOST_GAPS_TOLD} further stretches of it")
        if not self._whole:
            found.append(
                f"{name} does not end as it should: its recorder is still at work or was killed, "
                "or the file was cut off or damaged"
            )
        for channel, lost in self._lost.items():
            topic = self.channels[channel].topic
            found.append(f"{name}: {lost} messages that were recorded on {topic} are gone")
        found += [f"{name}: of what type {topic} is, is not told" for topic in self._undefined]
        return found

    def tables(self, name: str | None = None) -> Iterator[Metadata]:
        """Yield the readable metadata records, of that name or all, in file order."""
        for start, found in sorted(self._tables.items()):
            if name in (None, found):
                table = self._parsed(start, Opcode.METADATA, Metadata.read)
                if table is not None:
                    yield table

    def attachments(self, name: str | None = None) -> Iterator[Attachment]:
        """Yield the readable attachments, of that name or all, in file order."""
        for start, found in sorted(self._attachments.items()):
            if name in (None, found):
                attachment = self._parsed(start, Opcode.ATTACHMENT, Attachment.read)
                if attachment is not None:
                    yield attachment

    def blocks(self, channels: Collection[int]) -> Iterator[MessageBlock]:
        """Yield the messages on those channels in file order, those of a chunk at a time.

        One chunk is in memory; damaged ones are left out, and `damage` then tells of them. Raises
        BagError where the operating system fails to read the file.
        """
        counts: Counter[int] = Counter()
        for block in self._blocks():
            wanted = block.on(channels)
            if len(wanted) > 0:
                numbers = np.bincount(wanted.channel)
                counts.update({int(c): int(numbers[c]) for c in np.flatnonzero(numbers)})
                yield from wanted.unpacked()
        recorded = self.statistics.channel_message_counts if self.statistics else {}
        for channel in set(channels) & set(self.channels):
            lost = recorded.get(channel, 0) - int(counts[channel])
            if lost > 0:
                self._lost[channel] = lost

    def _blocks(self) -> Iterator[MessageBlock]:
        """Yield the messages of each chunk, and each run of messages that are in none."""
        loose: list[bytes] = []
        size = 0
        for record, chunk in self._records(len(MCAP0_MAGIC)):
            if record.opcode == Opcode.MESSAGE:
                loose.append(self._read(record.start, record.end - record.start))
                size += len(loose[-1])
            if loose and (record.opcode != Opcode.MESSAGE or size > _WINDOW):
                yield _as_block(loose)
                loose, size = [], 0
            if chunk is not None:
                yield chunk.messages
            elif record.opcode == Opcode.DATA_END:
                return
        if loose:
            yield _as_block(loose)

    def _read_inventory(self) -> bool:
        """Find what the file holds; return whether it begins and ends as it should."""
        data_start = len(MCAP0_MAGIC)
        begins_well = self._read(0, data_start) == MCAP0_MAGIC
        if not begins_well and self._next_chunk(0) == self._size:
            raise BagError(f"the file {self.path} is not an MCAP file: it does not begin like one")
        ends_well = self._read_summary()
        # A summary need not repeat the definitions.
        if not (ends_well and self.channels and not self._undefined):
            for record, chunk in self._records(data_start):
                if chunk is not None:
                    self._chunked = True
                    data = chunk.messages.data
                    for opcode, begin, end in chunk.others:
                        content = data[begin : min(end, begin + _LARGEST_TABLE)]
                        self._note(opcode, record.start, content, _CHECKED)
                elif record.opcode in _INVENTORY:
                    content = self._read(record.content, min(record.length, _LARGEST_TABLE))
                    self._note(record.opcode, record.start, content, 1)
            self._define()
        return begins_well and ends_well

    @property
    def _undefined(self) -> list[str]:
        """The topics of which no type is known, although they have one."""
        known = (0, *self.schemas)
        return [c.topic for c in self.channels.values() if c.schema_id not in known]

    def _read_summary(self) -> bool:
        """Note what the summary tells; return whether the file ends as its writer leaves it."""
        end = self._size - len(MCAP0_MAGIC) - _FOOTER_LENGTH - _HEAD.size
        if end < 0 or self._read(self._size - len(MCAP0_MAGIC), 8) != MCAP0_MAGIC:
            return False
        footer = self._parsed(end, Opcode.FOOTER, Footer.read)
        if footer is None:
            return False
        start = footer.summary_start
        if start == 0:
            return True
        # Looked at first: what a wrong place would have us read may be all the file.
        before = max(0, start - len(_DATA_END) - 4)
        if not 0 <= end - start <= LARGEST or self._read(before, len(_DATA_END)) != _DATA_END:
            return False
        summary = self._read(start, end - start)
        checked = self._read(end, _HEAD.size + _FOOTER_CHECKED)
        if footer.summary_crc not in (0, zlib.crc32(checked, zlib.crc32(summary))):
            return False
        try:
            for opcode, begin, stop in _records_in(summary):
                content = summary[begin : min(stop, begin + _LARGEST_TABLE)]
                self._note(opcode, start, content, _CHECKED)
        except _DamageError:
            return False
        self._define()
        return True

    def _note(self, opcode: int, start: int, content: bytes, weight: int) -> None:
        """Note what a record, or the one with it in it that starts there, tells of the file.

        Of one that is too large the content is cut short: the name of an attachment still is there.
        """
        try:
            match opcode:
                case Opcode.SCHEMA | Opcode.CHANNEL:
                    number = int.from_bytes(content[:2], "little")
                    if opcode == Opcode.CHANNEL:
                        self._channel_ids.add(number)
                    definition = opcode, number, content
                    if definition not in self._definitions:
                        self._account_for(content)
                    self._definitions[definition] += weight
                case Opcode.STATISTICS:
                    self.statistics = _parse(Statistics.read, content)
                    self._chunked = self.statistics.chunk_count > 0
                case Opcode.METADATA:
                    self._tables[start] = self._name_in(content, 0)
                case Opcode.METADATA_INDEX:
                    index = _parse(MetadataIndex.read, content)
                    self._account_for(index.name)
                    self._tables[index.offset] = index.name
                case Opcode.ATTACHMENT:
                    self._attachments[start] = self._name_in(content, _ATTACHMENT_TIMES)
                case Opcode.ATTACHMENT_INDEX:
                    index = _parse(AttachmentIndex.read, content)
                    self._account_for(index.name)
                    self._attachments[index.offset] = index.name
                case _:
                    pass
        except _DamageError:
            self._add_gap(start, start + _HEAD.size + len(content))

    def _name_in(self, content: bytes, place: int) -> str:
        """Return the text at a place of a record; raises _DamageError where there is none."""
        name = _parse(lambda stream: stream.read_prefixed_string(), content[place:])
        self._account_for(name)
        return name

    def _account_for(self, noted: bytes | str) -> None:
        """Raise _DamageError if there is no room to note this."""
        if self._noted + len(noted) + _NOTE > _MOST_NOTED:
            raise _DamageError
        self._noted += len(noted) + _NOTE

    def _add_gap(self, start: int, end: int) -> None:
        """Note that this cannot be read, within what was found before if that touches it."""
        last = next(reversed(self._gaps), start)
        if last <= start <= self._gaps.get(last, -1):
            self._gaps[last] = max(end, self._gaps[last])
        else:
            self._gaps[start] = end

    def _define(self) -> None:
        """Take of each schema and channel the definition found in a sound chunk, or most often."""
        for (opcode, _, content), _ in reversed(self._definitions.most_common()):
            try:
                if opcode == Opcode.SCHEMA:
                    schema = _parse(Schema.read, content)
                    self.schemas[schema.id] = schema
                else:
                    channel = _parse(Channel.read, content)
                    self.channels[channel.id] = channel
            except _DamageError:
                continue

    def _records(self, position: int) -> Iterator[tuple[_Record, _OpenChunk | None]]:
        """Yield the sound records from a position on; behind damage go on at the next chunk."""
        before = checked = position
        while position < self._size:
            record, chunk = self._record(position), None
            if record is not None and record.opcode == Opcode.CHUNK:
                chunk = self._opened(record)
                checked = position + 1 if chunk is None else record.end
            if record is None or (record.opcode == Opcode.CHUNK and chunk is None):
                # A record without a checksum may have covered the beginning of a chunk.
                following = self._next_chunk(checked)
                self._add_gap(min(position, max(before, following - 1)), following)
                position = following
                continue
            yield record, chunk
            if record.opcode == Opcode.FOOTER:
                return
            before, position = position, record.end

    def _record(self, position: int) -> _Record | None:
        """Return the record at a position if its fields fill it, and it lies within the file."""
        head = self._read(position, _HEAD.size)
        if len(head) < _HEAD.size:
            return None
        record = _Record(position, *_HEAD.unpack(head))
        if record.end > self._size:
            return None
        if record.opcode == Opcode.MESSAGE:
            channel = int.from_bytes(self._read(record.content, 2), "little")
            # Where there are chunks all messages are in them; this is something else, damaged.
            sound = channel in self._channel_ids and _MESSAGE_LENGTH <= record.length <= LARGEST
            return record if sound and not self._chunked else None
        if record.opcode not in _FIELDS:
            # Another program's own kind, if another record follows.
            following = self._read(record.end, 1)
            followed = bool(following) and (following[0] in _OPCODES or following[0] >= _PRIVATE)
            return record if record.opcode >= _PRIVATE and followed else None
        place = record.content
        for field in _FIELDS[record.opcode]:
            if field < 0:
                place += int.from_bytes(self._read(place, -field), "little") - field
            else:
                place += field
            if place > record.end:
                return None
        return record if place == record.end else None

    def _opened(self, record: _Record) -> _OpenChunk | None:
        """Return what is in a chunk, None if that is not what was written."""
        if record.length > LARGEST + _CHUNK_HEAD_SIZE:
            return None
        try:
            chunk = _parse(Chunk.read, self._read(record.content, record.length))
            data = unpack(chunk.compression, chunk.data, chunk.uncompressed_size)
            if data is None or chunk.uncompressed_crc not in (0, zlib.crc32(data)):
                return None
            return self._indexed(data, record.end) or _walked(data)
        except _DamageError:
            return None

    def _indexed(self, data: bytes, position: int) -> _OpenChunk | None:
        """Find the messages of a chunk by the indexes behind it; None if these are not right."""
        offsets: list[IntArray] = []
        room = len(data) // _MESSAGE_SIZE * _INDEX_ENTRY
        while (record := self._record(position)) and record.opcode == Opcode.MESSAGE_INDEX:
            size = record.length - _INDEX_HEAD
            room -= size
            if size % _INDEX_ENTRY or room < 0:
                return None
            entries = self._read(record.content + _INDEX_HEAD, size)
            offsets.append(np.frombuffer(entries, "<i8").reshape(-1, 2)[:, 1])
            position = record.end
        if not offsets:
            return None
        starts = np.sort(np.concatenate(offsets), kind="stable")
        if len(starts) == 0:
            return None
        try:
            messages = MessageBlock(data, starts)
            chunk = _OpenChunk(messages, int(starts[0]))
            deque(chunk.others, maxlen=0)  # each of them has to be sound
        except _DamageError:
            return None
        joined = np.array_equal(messages.end[:-1], starts[1:]) and messages.end[-1] == len(data)
        return chunk if joined else None

    def _next_chunk(self, position: int) -> int:
        """Return where the next chunk from a position on seems to start, or the file's size."""
        while position < self._size:
            window = self._read(position, _WINDOW + _CHUNK_HEAD_SIZE)
            match = _CHUNK_HEAD.search(window)
            while match and match.start() < _WINDOW:
                start = position + match.start()
                if self._record(start) is not None:
                    return start
                match = _CHUNK_HEAD.search(window, match.start() + 1)
            position += _WINDOW
        return self._size

    def _merged_gaps(self) -> list[tuple[int, int]]:
        merged: list[tuple[int, int]] = []
        for start, end in sorted(self._gaps.items()):
            if merged and start <= merged[-1][1]:
                merged[-1] = merged[-1][0], max(end, merged[-1][1])
            else:
                merged.append((start, end))
        return merged

    def _parsed(
        self, start: int | None, opcode: Opcode, read: Callable[[ReadDataStream], _Parsed]
    ) -> _Parsed | None:
        record = None if start is None else self._record(start)
        if record is None or record.opcode != opcode:
            return None
        try:
            if record.length > (LARGEST if opcode == Opcode.ATTACHMENT else _LARGEST_TABLE):
                raise _DamageError
            return _parse(read, self._read(record.content, record.length))
        except _DamageError:
            self._add_gap(record.start, record.end)
            return None

    def _read(self, start: int, size: int) -> bytes:
        try:
            self._stream.seek(start)
            return self._stream.read(size)
        except OSError as error:
            raise BagError(f"the file {self.path} cannot be read: {error.strerror}") from error


def _as_block(messages: list[bytes]) -> MessageBlock:
    """Return message records as a block."""
    data, starts, _ = joined(messages)
    return MessageBlock(data, starts)


def _walked(data: bytes) -> _OpenChunk:
    """Find the messages of a chunk by going from record to record."""
    messages = (begin for opcode, begin, _ in _records_in(data) if opcode == Opcode.MESSAGE)
    starts = np.array(array("q", messages), np.int64) - _HEAD.size
    return _OpenChunk(MessageBlock(data, starts), len(data))


def _records_in(data: bytes) -> Iterator[_Place]:
    """Yield the records that the data are made of; raises _DamageError where they are not."""
    position = 0
    while position < len(data):
        try:
            opcode, length = _HEAD.unpack_from(data, position)
        except struct.error as error:
            raise _DamageError from error
        begin = position + _HEAD.size
        position = begin + length
        if opcode == 0 or position > len(data):
            raise _DamageError
        yield opcode, begin, position


def _parse(read: Callable[[ReadDataStream], _Parsed], content: bytes) -> _Parsed:
    try:
        return read(ReadDataStream(BytesIO(content)))
    except (EndOfFile, struct.error, UnicodeDecodeError, OverflowError, ValueError) as error:
        raise _DamageError from error
