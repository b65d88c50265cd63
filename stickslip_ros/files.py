"""Files of others are read only if they are regular; own files are written whole or not at all."""

import errno
import os
import shutil
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from stat import S_ISREG
from typing import BinaryIO

from stickslip_ros.interrupts import interrupts_wait


def user_cache() -> Path:
    """Return the directory of this package in the user's cache; it may not exist.

    Raises RuntimeError where there is no home.
    """
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache, "stickslip_ros").absolute()


def open_regular(path: Path | str, *, links: bool = True) -> BinaryIO:
    """Open a regular file to read its bytes.

    Raises OSError for any other file: a pipe could wait for ever, and a device might never end.
    Without `links`, also if there is a link in the absolute path, or the file has a second name.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    about, refusal = os.fstat(descriptor), ""
    if not S_ISREG(about.st_mode):
        refusal = "it is not a regular file"
    elif not links and (
        about.st_nlink > 1 or os.readlink(f"/proc/self/fd/{descriptor}") != str(path)
    ):
        refusal = "it is a link"
    if refusal:
        os.close(descriptor)
        raise OSError(errno.EINVAL, refusal, str(path))
    return os.fdopen(descriptor, "rb")


@contextmanager
def written(
    path: Path, *, replace: bool = False, then: Callable[[], object] = lambda: None
) -> Generator[TextIOWrapper]:
    """Provide a UTF-8 file that becomes the one at `path`, flushed to the disk, at the end.

    It is followed by `then`, which removes what is of no use any more: no SIGINT comes in between.
    If the block fails, `path` stays as it was. Bytes go to the file's `buffer`. Raises OSError if
    it cannot be written, or if there is a file at `path` by then that is not to `replace`.
    """
    path = Path(os.path.realpath(path))  # a link stays a link
    part = path.with_name(f".{os.urandom(8).hex()}.part")  # nobody else has made it
    try:
        with part.open("x", encoding="utf-8", newline="") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        with suppress(OSError):
            shutil.copymode(path, part)
        with interrupts_wait():
            if not replace and path.exists():
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
            part.replace(path)
            then()
    finally:
        part.unlink(missing_ok=True)
