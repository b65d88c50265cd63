"""One MCAP file, read as far as it goes: a recorder that was killed leaves a file without an end.

The mcap library parses the records. Going from record to record is done here: the library fails
where a file is cut off, and takes apart the message indexes, which costs as much as the messages.
"""

import struct
from collections.abc import Callable, Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from stickslip_ros.errors import BagError

_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<H4xQ8x")
_FOOTER = struct.Struct("<BQQ12x8s")
_FOOTER_LENGTH = 20
_INVENTORY = frozenset(
    (
        Opcode.SCHEMA,
        Opcode.CHANNEL,
        Opcode.STATISTICS,
        Opcode.METADATA,
        Opcode.METADATA_INDEX,
        Opcode.ATTACHMENT,
        Opcode.ATTACHMENT_INDEX,
    )
)

_Record = TypeVar("_Record")


class _DamageError(Exception):
    """A record is not what it says."""


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
        self._metadata_starts: dict[str, int] = {}
        self._attachment_starts: dict[str, int] = {}
        try:
            self._stream = path.open("rb")
        except OSError as error:
            raise BagError(f"the file {path} cannot be opened: {error.strerror}") from error
        try:
            self._size = self._stream.seek(0, 2)
            if self._read(0, len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise BagError(f"the file {path} is not an MCAP file: it does not begin like one")
            self.complete = self._read_inventory()
            """Whether the file has its end, and no message that was read since was damaged."""
        except BaseException:
            self._stream.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def messages(self, channels: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield channel, log time in ns and data of the messages on those channels, in file order.

        One chunk at a time is in memory; damaged ones are left out. Raises BagError where the
        operating system fails to read the file.
        """
        for opcode, start, length in self._records(len(MCAP0_MAGIC)):
            if opcode == Opcode.DATA_END:
                return
            try:
                if opcode == Opcode.CHUNK:
                    data = self._chunk_data(start, length)
                    for record, begin, end in _records_in(data):
                        if record == Opcode.MESSAGE:
                            channel, log_time = _MESSAGE_HEAD.unpack_from(data, begin)
                            if channel in channels:
                                yield channel, log_time, data[begin + _MESSAGE_HEAD.size : end]
                elif opcode == Opcode.MESSAGE:
                    data = self._content(start, length)
                    channel, log_time = _MESSAGE_HEAD.unpack_from(data)
                    if channel in channels:
                        yield channel, log_time, data[_MESSAGE_HEAD.size :]
            except (_DamageError, struct.error):
                self.complete = False
        self.complete = False

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return the last readable metadata record of that name, None if there is none."""
        record = self._record_at(self._metadata_starts.get(name), Metadata.read)
        return record and record.metadata

    def attachment(self, name: str) -> bytes | None:
        """Return the last readable attachment of that name, None if there is none."""
        record = self._record_at(self._attachment_starts.get(name), Attachment.read)
        return record and record.data

    def _read_inventory(self) -> bool:
        """Find what the file holds; return whether its end is as its writer leaves it."""
        data_start = len(MCAP0_MAGIC)
        complete = False
        footer = self._read(max(0, self._size - _FOOTER.size), _FOOTER.size)
        if len(footer) == _FOOTER.size:
            opcode, length, summary_start, magic = _FOOTER.unpack(footer)
            if (opcode, length, magic) == (Opcode.FOOTER, _FOOTER_LENGTH, MCAP0_MAGIC):
                complete = self._collect(summary_start or data_start)
        # A summary need not repeat the channels.
        if not (complete and self.channels):
            self._collect(data_start)
        return complete

    def _collect(self, position: int) -> bool:
        """Note all records from there on but messages; return whether they are undamaged."""
        undamaged = True
        for opcode, start, length in self._records(position):
            try:
                if opcode == Opcode.CHUNK:
                    data = self._chunk_data(start, length)
                    for nested, begin, end in _records_in(data):
                        if nested != Opcode.MESSAGE:
                            self._note(nested, start, data[begin:end])
                elif opcode in _INVENTORY:
                    self._note(opcode, start, self._content(start, length))
            except _DamageError:
                undamaged = False
        return undamaged

    def _note(self, opcode: int, start: int, content: bytes) -> None:
        match opcode:
            case Opcode.SCHEMA:
                schema = _parse(Schema.read, content)
                self.schemas[schema.id] = schema
            case Opcode.CHANNEL:
                channel = _parse(Channel.read, content)
                self.channels[channel.id] = channel
            case Opcode.STATISTICS:
                self.statistics = _parse(Statistics.read, content)
            case Opcode.METADATA:
                self._metadata_starts[_parse(Metadata.read, content).name] = start
            case Opcode.METADATA_INDEX:
                index = _parse(MetadataIndex.read, content)
                self._metadata_starts[index.name] = index.offset
            case Opcode.ATTACHMENT:
                self._attachment_starts[_parse(Attachment.read, content).name] = start
            case Opcode.ATTACHMENT_INDEX:
                index = _parse(AttachmentIndex.read, content)
                self._attachment_starts[index.name] = index.offset
            case _:
                pass

    def _record_at(
        self, start: int | None, read: Callable[[ReadDataStream], _Record]
    ) -> _Record | None:
        found = None if start is None else next(self._records(start), None)
        if found is None:
            return None
        try:
            return _parse(read, self._content(*found[1:]))
        except _DamageError:
            return None

    def _records(self, position: int) -> Iterator[tuple[int, int, int]]:
        """Yield opcode, start and content length of the whole records from a position on."""
        while position + _RECORD_HEAD.size <= self._size:
            opcode, length = _RECORD_HEAD.unpack(self._read(position, _RECORD_HEAD.size))
            end = position + _RECORD_HEAD.size + length
            if opcode == 0 or end > self._size:
                return
            yield opcode, position, length
            if opcode == Opcode.FOOTER:
                return
            position = end

    def _content(self, start: int, length: int) -> bytes:
        return self._read(start + _RECORD_HEAD.size, length)

    def _chunk_data(self, start: int, length: int) -> bytes:
        """Return the decompressed records of the chunk that starts there."""
        chunk = _parse(Chunk.read, self._content(start, length))
        try:
            stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        except Exception as error:  # each compression has exceptions of its own
            raise _DamageError from error
        return stream.read(size)

    def _read(self, start: int, size: int) -> bytes:
        try:
            self._stream.seek(start)
            return self._stream.read(size)
        except OSError as error:
            raise BagError(f"the file {self.path} cannot be read: {error.strerror}") from error


def _records_in(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of the content of each record of a chunk."""
    position = 0
    while position < len(data):
        try:
            opcode, length = _RECORD_HEAD.unpack_from(data, position)
        except struct.error as error:
            raise _DamageError from error
        begin = position + _RECORD_HEAD.size
        position = begin + length
        if position > len(data):
            raise _DamageError
        yield opcode, begin, position


def _parse(read: Callable[[ReadDataStream], _Record], content: bytes) -> _Record:
    try:
        return read(ReadDataStream(BytesIO(content)))
    except (EndOfFile, struct.error, UnicodeDecodeError, OverflowError) as error:
        raise _DamageError from error
