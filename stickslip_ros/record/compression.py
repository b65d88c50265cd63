"""Decompress chunks, messages and files, never into more memory than their stated size."""

import errno
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from lz4.frame import LZ4FrameDecompressor
from zstandard import ZstdDecompressor, ZstdError, frame_content_size

from stickslip_ros.files import open_regular

LARGEST = 1 << 28
"""Bytes of the largest chunk or message that is accepted."""
_PIECE = 4 << 20

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame; no serialized message starts with them."""


def unpack(compression: str, data: bytes, size: int) -> bytes | None:
    """Decompress `lz4`, `zstd` or uncompressed data; return None if the result has another size."""
    if size > LARGEST:
        return None
    match compression:
        case "":
            unpacked = data
        case "lz4":
            unpacked = _unpack_lz4(data, size)
        case "zstd":
            unpacked = _gathered(ZstdDecompressor().stream_reader(data).read, size)
        case _:
            return None
    return unpacked if len(unpacked) == size else None


def unpack_message(data: bytes) -> bytes:
    """Return a message that rosbag2 compressed by itself (zstd) unpacked; any other unchanged."""
    try:
        return unpack("zstd", data, frame_content_size(data)) or data
    except ZstdError:
        return data


def unpack_file(packed: Path, unpacked: Path) -> None:
    """Decompress a zstd file into another one, up to the first damage.

    Raises OSError, also before the result takes more than half of the free disk space.
    """
    room = shutil.disk_usage(unpacked.parent).free // 2
    with open_regular(packed) as source, unpacked.open("wb") as target, suppress(ZstdError):
        for piece in ZstdDecompressor().read_to_iter(source, write_size=_PIECE):
            room -= len(piece)
            if room < 0:
                raise OSError(
                    errno.ENOSPC,
                    f"it would take more than half of the free space in {unpacked.parent}",
                )
            target.write(piece)


def _unpack_lz4(data: bytes, size: int) -> bytes:
    decompressor, packed = LZ4FrameDecompressor(), iter((data,))

    def read(most: int) -> bytes:
        return b"" if decompressor.eof else decompressor.decompress(next(packed, b""), most)

    return _gathered(read, size)


def _gathered(read: Callable[[int], bytes], size: int) -> bytes:
    """Read in pieces, so that a false size costs nothing, until `size` is exceeded or the end."""
    pieces: list[bytes] = []
    missing = size + 1
    try:
        while missing > 0 and (piece := read(min(missing, _PIECE))):
            pieces.append(piece)
            missing -= len(piece)
    except (RuntimeError, ZstdError):
        return b""
    return b"".join(pieces)
