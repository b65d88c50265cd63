"""Records of MCAP: a head of opcode and length, then the fields that belong to the opcode."""

import struct
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

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
