"""Read one MCAP file, also one that is incomplete (recorder killed) or damaged.

The mcap library parses the records. This module steps from record to record, because the library
fails on a truncated or damaged file and parses messages one by one. A record is sound if its
fields fill it exactly; a chunk must also have the right checksum. After any damage, reading
continues at the next sound chunk.
"""

import re
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
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

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError
from stickslip_ros.files import open_regular
from stickslip_ros.record.chunk import (
    DEFINITIONS,
    FIELDS,
    HEAD,
    LARGEST_TABLE,
    MESSAGE_LENGTH,
    MESSAGE_SIZE,
    WINDOW,
    DamageError,
    MessageBlock,
    OpenChunk,
    ParsedT,
    as_block,
    open_chunk,
    parse,
    records_in,
)
from stickslip_ros.record.compression import LARGEST, unpack

DefinitionT = TypeVar("DefinitionT", Schema, Channel)

_INDEX_ENTRY = 16
"""Bytes of a log time and an offset in a message index."""
_DATA_END = HEAD.pack(Opcode.DATA_END, 4)
_OPCODES = frozenset((*FIELDS, Opcode.MESSAGE))
_PRIVATE_FROM = 0x80
"""Opcodes from this one on are private to an application."""
_INVENTORY = frozenset((*DEFINITIONS, Opcode.METADATA, Opcode.ATTACHMENT))
"""Records between the messages that define or describe them."""
_LARGEST_DEFINITIONS = 32 << 20
"""Bytes of all definitions that are kept."""
_MOST_GAPS_LISTED = 20

_CHUNK_HEAD = re.compile(
    rb"\x06.{5}\0\0\0.{28}(?:\0\0\0\0|\x03\0\0\0lz4|\x04\0\0\0zstd)", re.DOTALL
)
_CHUNK_HEAD_SIZE = 9 + 28 + 8


class _Record(NamedTuple):
    """A sound record of a file."""

    start: int
    opcode: int
    length: int
    """Bytes of the content."""

    @property
    def content(self) -> int:
        return self.start + HEAD.size

    @property
    def end(self) -> int:
        return self.content + self.length


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
        self._tables: dict[int, str] = {}
        self._attachments: dict[int, str] = {}
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
        found = [
            f"{name}: bytes {start} to {end - 1} of {self._size} cannot be read"
            for start, end in gaps[:_MOST_GAPS_LISTED]
        ]
        if len(gaps) > _MOST_GAPS_LISTED:
            more = len(gaps) - _MOST_GAPS_LISTED
            found.append(f"{name}: {more} further ranges of bytes cannot be read")
        if not self._whole:
            found.append(
                f"{name} is incomplete: its recorder is still running or was killed, "
                "or the file was truncated or damaged"
            )
        for channel, lost in self._lost.items():
            topic = self.channels[channel].topic
            found.append(f"{name}: {lost} messages recorded on {topic} are missing")
        found += [f"{name}: the type of {topic} is missing" for topic in self._undefined]
        return found

    def tables(self, name: str | None = None) -> Iterator[Metadata]:
        """Yield the readable metadata records, of this name or all, in file order."""
        return self._named(self._tables, name, Opcode.METADATA, Metadata.read)

    def attachments(self, name: str | None = None) -> Iterator[Attachment]:
        """Yield the readable attachments, of this name or all, in file order."""
        return self._named(self._attachments, name, Opcode.ATTACHMENT, Attachment.read)

    def blocks(self, channels: Collection[int]) -> Iterator[MessageBlock]:
        """Yield the messages on these channels in file order, one chunk at a time.

        Only one chunk is in memory. Damaged chunks are skipped and listed in `damage`. Raises
        BagError if the operating system fails to read the file.
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
        """Yield the messages of each chunk, and each sequence of messages outside chunks."""
        loose: list[bytes] = []
        size = 0
        for record, chunk in self._records(len(MCAP0_MAGIC)):
            if record.opcode == Opcode.MESSAGE:
                loose.append(self._read(record.start, record.end - record.start))
                size += len(loose[-1])
            if loose and (record.opcode != Opcode.MESSAGE or size > WINDOW):
                yield as_block(loose)
                loose, size = [], 0
            if chunk is not None:
                yield chunk.messages
            elif record.opcode == Opcode.DATA_END:
                return
        if loose:
            yield as_block(loose)

    def _read_inventory(self) -> bool:
        """Find the content of the file; return whether its beginning and end are sound."""
        data_start = len(MCAP0_MAGIC)
        begins_well = self._read(0, data_start) == MCAP0_MAGIC
        if not begins_well and self._next_chunk(0) == self._size:
            raise BagError(f"the file {self.path} is not an MCAP file: it does not start like one")
        ends_well = self._read_summary()
        # A summary need not repeat the definitions.
        if not (ends_well and self.channels and not self._undefined):
            for record, chunk in self._records(data_start):
                if chunk is not None:
                    self._chunked = True
                    for opcode, content in chunk.definitions:
                        self._note(opcode, record.start, content, checked=True)
                elif record.opcode in _INVENTORY:
                    content = self._read(record.content, min(record.length, LARGEST_TABLE))
                    self._note(record.opcode, record.start, content, checked=False)
        return begins_well and ends_well

    @property
    def _undefined(self) -> list[str]:
        """The topics whose type is unknown although they have one."""
        known = (0, *self.schemas)
        return [c.topic for c in self.channels.values() if c.schema_id not in known]

    def _read_summary(self) -> bool:
        """Read the summary; return whether the end of the file is sound."""
        end = self._size - len(MCAP0_MAGIC) - FIELDS[Opcode.FOOTER][0] - HEAD.size
        if end < 0 or self._read(self._size - len(MCAP0_MAGIC), 8) != MCAP0_MAGIC:
            return False
        footer = self._parsed(end, Opcode.FOOTER, Footer.read)
        if footer is None:
            return False
        start = footer.summary_start
        if start == 0:
            return True
        # Checked first: with a wrong position the summary might be the whole file.
        before = max(0, start - len(_DATA_END) - 4)
        moved = not 0 <= end - start <= LARGEST or self._read(before, len(_DATA_END)) != _DATA_END
        if moved:
            start = self._start_of_summary(end)
            if start is None or footer.summary_crc == 0:
                return False
        summary = self._read(start, end - start)
        checked = self._read(end, HEAD.size + 16)  # without the checksum itself
        if footer.summary_crc not in (0, zlib.crc32(checked, zlib.crc32(summary))):
            return False
        try:
            for opcode, begin, stop in records_in(summary):
                content = summary[begin : min(stop, begin + LARGEST_TABLE)]
                # Where bytes before it are lost, its definitions still hold, but no position.
                if not moved or opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._note(opcode, start, content, checked=True)
        except DamageError:
            return False
        return not moved

    def _start_of_summary(self, end: int) -> int | None:
        """Return where a summary that ends there starts; None if it is not found."""
        earliest = max(0, end - LARGEST_TABLE)
        place = self._read(earliest, end - earliest).rfind(_DATA_END)
        return None if place < 0 else earliest + place + len(_DATA_END) + 4

    def _note(self, opcode: int, start: int, content: bytes, *, checked: bool) -> None:
        """Keep what a record describes; `start` is its place, or that of the chunk around it.

        The content of a record that is too large is cut off; the name of an attachment remains.
        """
        try:
            match opcode:
                case Opcode.SCHEMA:
                    self._define(self.schemas, parse(Schema.read, content), len(content), checked)
                case Opcode.CHANNEL:
                    self._define(self.channels, parse(Channel.read, content), len(content), checked)
                case Opcode.STATISTICS:
                    self.statistics = parse(Statistics.read, content)
                    self._chunked = self.statistics.chunk_count > 0
                case Opcode.METADATA:
                    self._tables[start] = _text_at(0, content)
                case Opcode.METADATA_INDEX:
                    index = parse(MetadataIndex.read, content)
                    self._tables[index.offset] = index.name
                case Opcode.ATTACHMENT:
                    self._attachments[start] = _text_at(16, content)  # behind its times
                case Opcode.ATTACHMENT_INDEX:
                    index = parse(AttachmentIndex.read, content)
                    self._attachments[index.offset] = index.name
                case _:
                    pass
        except DamageError:
            self._add_gap(start, start + HEAD.size + len(content))

    def _add_gap(self, start: int, end: int) -> None:
        """Note that these bytes cannot be read."""
        self._gaps[start] = max(end, self._gaps.get(start, end))

    def _define(
        self, known: dict[int, DefinitionT], found: DefinitionT, size: int, checked: bool
    ) -> None:
        """Keep a definition; for each id the one with a checksum, or else the first."""
        if found.id not in known or (checked and known[found.id] != found):
            self._definitions_size += size
            if self._definitions_size > _LARGEST_DEFINITIONS:
                raise DamageError
            known[found.id] = found

    def _records(self, position: int) -> Iterator[tuple[_Record, OpenChunk | None]]:
        """Yield the sound records from a position on; after damage continue at the next chunk."""
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
        """Return the record at a position if its fields fill it and it lies within the file."""
        head = self._read(position, HEAD.size)
        if len(head) < HEAD.size:
            return None
        record = _Record(position, *HEAD.unpack(head))
        if record.end > self._size:
            return None
        if record.opcode == Opcode.MESSAGE:
            channel = int.from_bytes(self._read(record.content, 2), "little")
            # If a file has chunks, all messages are in them; this is damaged data.
            sound = channel in self.channels and MESSAGE_LENGTH <= record.length <= LARGEST
            return record if sound and not self._chunked else None
        if record.opcode not in FIELDS:
            # A private record of an application, if another record follows.
            following = self._read(record.end, 1)
            followed = bool(following) and (
                following[0] in _OPCODES or following[0] >= _PRIVATE_FROM
            )
            return record if record.opcode >= _PRIVATE_FROM and followed else None
        place = record.content
        for field in FIELDS[record.opcode]:
            if field < 0:
                place += int.from_bytes(self._read(place, -field), "little") - field
            else:
                place += field
            if place > record.end:
                return None
        return record if place == record.end else None

    def _opened(self, record: _Record) -> OpenChunk | None:
        """Return the content of a chunk, None if it is damaged."""
        if record.length > LARGEST + _CHUNK_HEAD_SIZE:
            return None
        try:
            chunk = parse(Chunk.read, self._read(record.content, record.length))
            data = unpack(chunk.compression, chunk.data, chunk.uncompressed_size)
            if data is None or chunk.uncompressed_crc not in (0, zlib.crc32(data)):
                return None
            return open_chunk(data, self._indexed_starts(data, record.end))
        except DamageError:
            return None

    def _indexed_starts(self, data: bytes, position: int) -> IntArray:
        """Return where the messages of a chunk start, by its indexes; none if these are damaged."""
        offsets = [np.empty(0, np.int64)]
        room = len(data) // MESSAGE_SIZE * _INDEX_ENTRY
        while (record := self._record(position)) and record.opcode == Opcode.MESSAGE_INDEX:
            size = record.length - 6  # without channel and size of the entries
            room -= size
            if size % _INDEX_ENTRY or room < 0:
                return np.empty(0, np.int64)
            entries = self._read(record.end - size, size)
            offsets.append(np.frombuffer(entries, "<i8").reshape(-1, 2)[:, 1])
            position = record.end
        return np.sort(np.concatenate(offsets), kind="stable")

    def _next_chunk(self, position: int) -> int:
        """Return where the next chunk from a position on probably starts, or the file's size."""
        while position < self._size:
            window = self._read(position, WINDOW + _CHUNK_HEAD_SIZE)
            match = _CHUNK_HEAD.search(window)
            while match and match.start() < WINDOW:
                start = position + match.start()
                if self._record(start) is not None:
                    return start
                match = _CHUNK_HEAD.search(window, match.start() + 1)
            position += WINDOW
        return self._size

    def _named(
        self,
        places: dict[int, str],
        name: str | None,
        opcode: Opcode,
        read: Callable[[ReadDataStream], ParsedT],
    ) -> Iterator[ParsedT]:
        for start, found in sorted(places.items()):
            if name in (None, found) and (parsed := self._parsed(start, opcode, read)) is not None:
                yield parsed

    def _parsed(
        self, start: int, opcode: Opcode, read: Callable[[ReadDataStream], ParsedT]
    ) -> ParsedT | None:
        record = self._record(start)
        if record is None or record.opcode != opcode:
            return None
        try:
            if record.length > (LARGEST if opcode == Opcode.ATTACHMENT else LARGEST_TABLE):
                raise DamageError
            return parse(read, self._read(record.content, record.length))
        except DamageError:
            self._add_gap(record.start, record.end)
            return None

    def _read(self, start: int, size: int) -> bytes:
        try:
            self._stream.seek(start)
            return self._stream.read(size)
        except OSError as error:
            raise BagError(f"the file {self.path} cannot be read: {error.strerror}") from error


def _text_at(place: int, content: bytes) -> str:
    """Return the text at a place of a record; raise DamageError if there is none."""
    return parse(lambda stream: stream.read_prefixed_string(), content[place:])
