"""Write one file of a bag: an MCAP file in whole records, with the definitions of the bag."""

import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from io import BufferedWriter, FileIO
from math import inf
from pathlib import Path
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer

from stickslip_ros.record.metadata import opening_information

LAST_STAMP = 2**63 - 1
"""Latest stamp that rosbag2 can read, ns."""


class Definitions:
    """What each file of a bag repeats: types, topics and tables."""

    def __init__(self) -> None:
        self.topics: list[str] = []
        """Names of the topics, by the order of their channels."""
        self.tables: dict[str, dict[str, str]] = {}
        """Metadata tables by name."""
        self.records = b""
        """Types and topics as records."""
        self._schemas: list[Schema] = []
        self._definitions: list[Schema | Channel] = []

    def add(self, channel: Channel, schema: Schema, file: "FileWriter") -> None:
        """Add a channel, and its type if that is new, also to a file; their ids are ignored."""
        new: list[Schema | Channel] = []
        schema = replace(schema, id=0)
        if schema not in self._schemas:
            self._schemas.append(schema)
            new.append(replace(schema, id=len(self._schemas)))
        schema_id = self._schemas.index(schema) + 1
        self.topics.append(channel.topic)
        new.append(replace(channel, id=len(self.topics), schema_id=schema_id))
        _register(file.writer, new)
        builder = RecordBuilder()
        for definition in new:
            definition.write(builder)
        records = builder.end()
        file.stream.write(records)
        self._definitions += new
        self.records += records

    def write(self, writer: Writer, stream: "_RecordStream") -> None:
        """Write all into a new file."""
        for name, table in self.tables.items():
            writer.add_metadata(name, table)
        _register(writer, self._definitions)
        stream.write(self.records)


class _RecordStream(BufferedWriter):
    """A new file that is written in whole records and can be truncated after the last one."""

    def __init__(self, path: Path, on_full: Callable[[], None]) -> None:
        super().__init__(FileIO(path, "xb"))
        self.path = path
        self.size = 0
        """Bytes of the whole records that were passed to the operating system."""
        self.limit = inf
        """Size from which on the file is full."""
        self._on_full = on_full

    def write(self, records: Any, /) -> int:
        written = super().write(records)
        self.flush()
        self.size += written
        if self.size >= self.limit:
            self._on_full()
        return written

    def sync(self) -> None:
        """Sync the written data to the disk."""
        os.fdatasync(self.fileno())

    def cut(self) -> None:
        """Truncate the file after its last whole record and close it, even if the disk fails."""
        if self.closed:
            return
        with suppress(OSError):
            os.ftruncate(self.fileno(), self.size)
            self.sync()
        with suppress(OSError):
            self.raw.close()  # does not write the buffered half of a record


class FileWriter:
    """A file of a bag that is being written."""

    def __init__(self, path: Path, compression: CompressionType, definitions: Definitions) -> None:
        """Start the file; raises OSError and ValueError, and leaves none, if this fails."""
        self.stream = stream = _RecordStream(path, self._on_full)
        try:
            self.writer = Writer(stream, compression=compression)
            self.writer.start(profile="ros2")
            information = opening_information(path.name)
            self.writer.add_metadata("rosbag2", {"serialized_metadata": information})
            definitions.write(self.writer, stream)
        except (OSError, ValueError):
            stream.cut()
            path.unlink()
            raise
        self.earliest = self.latest = LAST_STAMP
        """Stamps between which messages belong in the file, as far as it is known."""
        self._synced_size, self._next_sync = 0, 0.0
        self._defined_size = stream.size

    def admit(self, stamp: int, max_size: int, max_duration: int) -> None:
        """Take in a message with an early stamp; limits are in bytes and ns, 0 for none."""
        if max_size and self.earliest == LAST_STAMP:
            # A file grows by whole chunks: a limit below its start still admits one chunk.
            self.stream.limit = max(max_size, self.stream.size + 1)
        self.earliest = min(stamp, self.earliest)
        if max_duration:
            self.latest = min(self.earliest + max_duration, LAST_STAMP)

    def flush(self, definitions: bytes) -> bool:
        """Pass all data to the operating system; return whether they should be synced."""
        self.writer.flush()
        grown = self.stream.size - self._defined_size
        # Repeated outside the chunks, in case the first are damaged: at most 2 % of a file.
        if 0.02 * grown > len(definitions):
            self.stream.write(definitions)
            self._defined_size = self.stream.size
        now = time.monotonic()
        if self.stream.size <= self._synced_size or now < self._next_sync:
            return False
        self._synced_size = self.stream.size
        self._next_sync = now + 0.1  # s: a sync slows down the caller
        return True

    def finish(self) -> None:
        """Complete the file and sync it; if this fails, raise OSError and leave whole records."""
        try:
            self.writer.finish()
            self.stream.sync()
            self.stream.close()
        except OSError:
            self.stream.cut()
            raise

    def _on_full(self) -> None:
        """Put the next message into a new file."""
        self.latest = -1


def _register(writer: Writer, definitions: Sequence[Schema | Channel]) -> None:
    """Register definitions with a writer: the same order gives the same ids."""
    for new in definitions:
        if isinstance(new, Schema):
            writer.register_schema(new.name, new.encoding, new.data)
        else:
            writer.register_channel(new.topic, new.message_encoding, new.schema_id, new.metadata)
