"""Read one MCAP file, also one that is incomplete (recorder killed) or damaged.

The mcap library parses the records. This module steps from record to record, because the library
fails on a truncated or damaged file, reads what a damaged length says into memory, and parses
messages and their indexes one by one. A chunk is sound if its checksum and its records are; after
any damage, reading continues at the next sound chunk.
"""

import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from io import BytesIO
from itertools import groupby, takewhile
from pathlib import Path
from typing import NamedTuple, TypeVar

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

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError
from stickslip_ros.files import open_regular
from stickslip_ros.record.chunk import (
    DEFINITIONS,
    HEAD,
    LARGEST_TABLE,
    MESSAGE_LENGTH,
    MESSAGE_SIZE,
    WINDOW,
    DamageError,
    MessageBlock,
    OpenChunk,
    as_blocks,
    open_chunk,
    records_in,
)
from stickslip_ros.record.compression import LARGEST, unpack

ParsedT = TypeVar("ParsedT")
NamedT = TypeVar("NamedT", Metadata, Attachment)
DefinitionT = TypeVar("DefinitionT", Schema, Channel)

_INDEX_ENTRY = 16
"""Bytes of a log time and an offset in a message index."""
_DATA_END = HEAD.pack(Opcode.DATA_END, 4)
_FOOTER = HEAD.pack(Opcode.FOOTER, 20)
_MAGIC = b"\x89MCAP0\r\n"
"""What a file begins and ends with; mcap has it where it loads the metadata of all packages."""
_TAIL_SIZE = len(_FOOTER) + 20 + len(_MAGIC)
"""Bytes of the footer and of what ends a file."""
_OPCODES = frozenset((*Opcode, *range(0x80, 0x100)))
"""From 0x80 on they are private to an application."""
_INVENTORY = (*DEFINITIONS, Opcode.METADATA, Opcode.ATTACHMENT)
"""Records between the messages that define or describe them."""
_LARGEST_DEFINITIONS = 32 << 20
"""Bytes of all definitions that are kept."""
_MOST_GAPS_LISTED = 20

_CHUNK = re.compile(
    rb"\x06(?=(.{5})\0\0\0.{28}(\0{4}|\x03\0{3}lz4|\x04\0{3}zstd)(.{5})\0\0\0)", re.DOTALL
)
"""The start of a chunk, its length, compression, and size of the data."""
_CHUNK_LENGTH = 28 + 4 + 8
"""Bytes of the content of a chunk, without the name of the compression and the data."""
_CHUNK_HEAD_SIZE = HEAD.size + _CHUNK_LENGTH + 4


class _Record(NamedTuple):
    opcode: int
    start: int
    end: int
    chunk: OpenChunk | None = None

    @property
    def begin(self) -> int:
        """Where the content begins."""
        return self.start + HEAD.size


class McapFile:
    """An MCAP file that is open for reading."""

    def __init__(self, path: Path) -> None:
        """Open the file; raise BagError if it cannot be opened or is not MCAP."""
        self.path = path
        self.schemas: dict[int, Schema] = {}
        """By id."""
        self.channels: dict[int, Channel] = {}
        """By id."""
        self.statistics: Statistics | None = None
        """The statistics record of the file, if it has one."""
        self._places: dict[int, set[int]] = {Opcode.METADATA: set(), Opcode.ATTACHMENT: set()}
        """Where tables and attachments probably are."""
        self._definitions_size = 0
        self._chunked = False
        self._gaps: dict[int, int] = {}
        self._lost: dict[int, int] = {}
        try:
            self._stream = open_regular(path)
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
        """Sentences on what is missing from the file; reading may find more."""
        name = self.path.name
        gaps: list[tuple[int, int]] = []
        for start, end in sorted(self._gaps.items()):
            if gaps and start <= gaps[-1][1]:
                gaps[-1] = gaps[-1][0], max(end, gaps[-1][1])
            else:
                gaps.append((start, end))
        sentences = [
            f"{name}: bytes {start} to {end - 1} of {self._size} cannot be read"
            for start, end in gaps[:_MOST_GAPS_LISTED]
        ]
        if len(gaps) > _MOST_GAPS_LISTED:
            more = len(gaps) - _MOST_GAPS_LISTED
            sentences.append(f"{name}: {more} further ranges of bytes cannot be read")
        if not self._whole:
            sentences.append(
                f"{name} is incomplete: its recorder is still running or was killed, "
                "or the file was truncated or damaged"
            )
        for channel, lost in self._lost.items():
            topic = self.channels[channel].topic
            sentences.append(f"{name}: {lost} messages recorded on {topic} are missing")
        sentences += [f"{name}: the type of {topic} is missing" for topic in self._undefined]
        return sentences

    def tables(self, name: str | None = None) -> Iterator[Metadata]:
        """Yield the readable metadata records, of this name or all, in file order."""
        return self._named(name, Opcode.METADATA, Metadata.read, LARGEST_TABLE)

    def attachments(self, name: str | None = None) -> Iterator[Attachment]:
        """Yield the readable attachments, of this name or all, in file order."""
        return self._named(name, Opcode.ATTACHMENT, Attachment.read, LARGEST)

    def blocks(self, channels: Collection[int]) -> Iterator[MessageBlock]:
        """Yield the messages on these channels in file order, one chunk at a time.

        Only one chunk is in memory. Damaged chunks are skipped and listed in `damage`. Raises
        BagError if the operating system fails to read the file.
        """
        counts: Counter[int] = Counter()
        for block in self._blocks():
            wanted = block.on_channels(channels)
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
        """Yield the messages of each chunk, and each sequence of messages outside chunks."""
        data = takewhile(lambda record: record.opcode != Opcode.DATA_END, self._records())
        for opcode, records in groupby(data, lambda record: record.opcode):
            if opcode == Opcode.MESSAGE:
                yield from as_blocks(self._read(record.start, record.end) for record in records)
            else:
                chunks = (record.chunk for record in records)
                yield from (chunk.messages for chunk in chunks if chunk is not None)

    def _read_inventory(self) -> bool:
        """Find the content of the file; return whether its beginning and end are sound."""
        begins_well = self._read(0, len(_MAGIC)) == _MAGIC
        if not begins_well and self._next_chunk(0) == self._size:
            raise BagError(f"the file {self.path} is not an MCAP file: it does not start like one")
        ends_well = self._read_summary()
        # A summary need not repeat the definitions.
        if not (ends_well and self.channels and not self._undefined):
            for record in self._records():
                if record.chunk is not None:
                    self._chunked = True
                    for opcode, content in record.chunk.definitions:
                        self._note(opcode, record.start, content, checked=True)
                elif record.opcode in _INVENTORY:
                    end = min(record.end, record.begin + LARGEST_TABLE)
                    content = self._read(record.begin, end)
                    self._note(record.opcode, record.start, content, checked=False)
        return begins_well and ends_well

    @property
    def _undefined(self) -> list[str]:
        """The topics whose type is unknown although they have one."""
        known = (0, *self.schemas)
        return [c.topic for c in self.channels.values() if c.schema_id not in known]

    def _read_summary(self) -> bool:
        """Read the summary; return whether the end of the file is sound."""
        end = self._size - _TAIL_SIZE
        tail = self._read(max(0, end), self._size)
        if not (tail.startswith(_FOOTER) and tail.endswith(_MAGIC)):
            return False
        footer = _parse(Footer.read, tail[HEAD.size : -len(_MAGIC)])
        start = footer.summary_start
        if start == 0:
            return True
        # Checked first: with a wrong position the summary might be the whole file.
        before = max(0, start - len(_DATA_END) - 4)
        moved = not 0 <= end - start <= LARGEST or self._read(before, start - 4) != _DATA_END
        if moved:
            earliest = max(0, end - LARGEST_TABLE)
            place = self._read(earliest, end).rfind(_DATA_END)
            if place < 0 or footer.summary_crc == 0:
                return False
            start = earliest + place + len(_DATA_END) + 4
        summary = self._read(start, end)
        checked = tail[: HEAD.size + 16]  # without the checksum itself
        if footer.summary_crc not in (0, zlib.crc32(checked, zlib.crc32(summary))):
            return False
        try:
            for opcode, begin, stop in records_in(summary):
                content = summary[begin : min(stop, begin + LARGEST_TABLE)]
                # Where bytes before it are lost, its definitions still hold, but no position.
                if not moved or opcode in DEFINITIONS:
                    self._note(opcode, start, content, checked=True)
        except DamageError:
            return False
        return not moved

    def _note(self, opcode: int, start: int, content: bytes, *, checked: bool) -> None:
        """Keep what a record describes; `start` is its place, or that of the chunk around it."""
        try:
            match opcode:
                case Opcode.SCHEMA:
                    self._define(self.schemas, _parse(Schema.read, content), content, checked)
                case Opcode.CHANNEL:
                    self._define(self.channels, _parse(Channel.read, content), content, checked)
                case Opcode.STATISTICS:
                    self.statistics = _parse(Statistics.read, content)
                    self._chunked = self.statistics.chunk_count > 0
                case Opcode.METADATA | Opcode.ATTACHMENT:
                    self._places[opcode].add(start)
                case Opcode.METADATA_INDEX:
                    self._places[Opcode.METADATA].add(_parse(MetadataIndex.read, content).offset)
                case Opcode.ATTACHMENT_INDEX:
                    place = _parse(AttachmentIndex.read, content).offset
                    self._places[Opcode.ATTACHMENT].add(place)
                case _:
                    pass
        except DamageError:
            self._add_gap(start, start + HEAD.size + len(content))

    def _add_gap(self, start: int, end: int) -> None:
        self._gaps[start] = max(end, self._gaps.get(start, end))

    def _define(
        self, known: dict[int, DefinitionT], definition: DefinitionT, content: bytes, checked: bool
    ) -> None:
        """Keep a definition; for each id the one with a checksum, or else the first."""
        if definition.id not in known or (checked and known[definition.id] != definition):
            self._definitions_size += len(content)
            if self._definitions_size > _LARGEST_DEFINITIONS:
                raise DamageError
            known[definition.id] = definition

    def _records(self) -> Iterator[_Record]:
        """Yield the records up to the footer; after damage continue at the next chunk."""
        position = before = searched = len(_MAGIC)
        while position < self._size:
            record = self._record(position)
            try:
                if record.opcode == Opcode.CHUNK:
                    searched = position + 1
                    record = record._replace(chunk=self._opened(record))
                    searched = record.end
                elif record.opcode not in _OPCODES or (
                    record.opcode == Opcode.MESSAGE and not self._is_loose(record)
                ):
                    raise DamageError
            except DamageError:
                # A record without a checksum may have covered the beginning of a chunk.
                following = self._next_chunk(searched)
                self._add_gap(min(position, max(before, following - 1)), following)
                position = following
                continue
            yield record
            if record.opcode == Opcode.FOOTER:
                return
            before, position = position, record.end

    def _record(self, start: int) -> _Record:
        """Return the record at a place, one of opcode 0 if there is none within the file."""
        begin = start + HEAD.size
        head = self._read(start, begin) if begin <= self._size else b""
        opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
        return _Record(opcode if begin + length <= self._size else 0, start, begin + length)

    def _is_loose(self, record: _Record) -> bool:
        channel = int.from_bytes(self._read(record.begin, record.begin + 2), "little")
        sound = channel in self.channels and MESSAGE_LENGTH <= record.end - record.begin <= LARGEST
        # If a file has chunks, all messages are in them; this is damaged data.
        return sound and not self._chunked

    def _opened(self, record: _Record) -> OpenChunk:
        """Return the content of a chunk; raise DamageError if it is damaged."""
        if record.end - record.begin > LARGEST + _CHUNK_HEAD_SIZE:
            raise DamageError
        chunk = _parse(Chunk.read, self._read(record.begin, record.end))
        data = unpack(chunk.compression, chunk.data, chunk.uncompressed_size)
        if data is None or chunk.uncompressed_crc not in (0, zlib.crc32(data)):
            raise DamageError
        return open_chunk(data, self._indexed_starts(data, record.end))

    def _indexed_starts(self, data: bytes, position: int) -> IntArray:
        """Return where the messages of a chunk start, by its indexes; none if these are damaged."""
        offsets = [np.empty(0, np.int64)]
        room = len(data) // MESSAGE_SIZE * _INDEX_ENTRY
        while (record := self._record(position)).opcode == Opcode.MESSAGE_INDEX:
            begin = record.begin + 6  # behind channel and size of the entries
            room -= record.end - begin
            if (record.end - begin) % _INDEX_ENTRY or room < 0:
                return np.empty(0, np.int64)
            entries = self._read(begin, record.end)
            offsets.append(np.frombuffer(entries, "<i8").reshape(-1, 2)[:, 1])
            position = record.end
        return np.sort(np.concatenate(offsets), kind="stable")

    def _next_chunk(self, position: int) -> int:
        """Return where the next chunk from a position on probably starts, or the file's size."""
        while position < self._size:
            window = self._read(position, position + WINDOW + _CHUNK_HEAD_SIZE)
            for match in _CHUNK.finditer(window):
                length, size = (int.from_bytes(match[number], "little") for number in (1, 3))
                start = position + match.start()
                fills = length == _CHUNK_LENGTH - 4 + len(match[2]) + size
                if fills and start + HEAD.size + length <= self._size:
                    return start
            position += WINDOW
        return self._size

    def _named(
        self,
        name: str | None,
        opcode: Opcode,
        read: Callable[[ReadDataStream], NamedT],
        largest: int,
    ) -> Iterator[NamedT]:
        for record in map(self._record, sorted(self._places[opcode])):
            if record.opcode != opcode:
                continue
            try:
                if record.end - record.begin > largest:
                    raise DamageError
                content = _parse(read, self._read(record.begin, record.end))
                if name in (None, content.name):
                    yield content
            except DamageError:
                self._add_gap(record.start, record.end)

    def _read(self, start: int, end: int) -> bytes:
        try:
            self._stream.seek(start)
            return self._stream.read(max(0, end - start))
        except OSError as error:
            raise BagError(f"the file {self.path} cannot be read: {error.strerror}") from error


def _parse(read: Callable[[ReadDataStream], ParsedT], content: bytes) -> ParsedT:
    """Parse a content with the mcap library; raise DamageError if it fails or leaves a rest."""
    stream = ReadDataStream(BytesIO(content))
    try:
        parsed = read(stream)
    except (EndOfFile, struct.error, OverflowError, ValueError) as error:
        raise DamageError from error
    if stream.count < len(content):
        raise DamageError
    return parsed
