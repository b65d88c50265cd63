"""Journals: the computed points of a study on disk, from which an interrupted study continues."""

import fcntl
import json
import os
import stat
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import astuple
from hashlib import sha256
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self
from zlib import crc32

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import user_cache
from stickslip_ros.installed_packages import versions
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.settling import MotionState
from stickslip_ros.studies.study import Piece, PointStudy

_OPENING, _VERSION = b'{"format": "stickslip_ros study ', b'2"'
_NO_JOURNAL = "exists already, and is not the journal of a study"


class Journal:
    """The computed points of a study, kept in a file if there is one; a context manager.

    The first line of the file describes the study, and each further line holds a piece; both are
    JSON, and a checksum of it and of its place. An unfinished last line, of a writer that was
    killed, is removed.
    """

    def __init__(
        self, study: PointStudy[Any], path: Path | None = None, columns: Any = None
    ) -> None:
        """Start a journal, or continue the one that exists; without a path only in memory.

        `columns` take the points; by default they are `Columns`.

        Raises InvalidInputError if the file is not a journal of this study or has been changed,
        another process writes it, or it cannot be written.
        """
        self.study, self.path = study, path
        self.columns = Columns.empty(study.plan) if columns is None else columns
        self.ends: dict[int, MotionState | None] = {}
        """State in which the newest point of a chain ended; None if it failed or diverged."""
        self._file: BinaryIO | None = None
        if path is None:
            return
        try:
            self._file = _opened(path)
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be written: {error.strerror}") from None
        try:
            self._read(self._file)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            if self._file is not None:
                self._file.close()
        except OSError:  # the same failure to write again
            if error is None:
                raise

    @property
    def count(self) -> int:
        """Number of points that are done."""
        return int(np.count_nonzero(self.columns.done))

    def add(self, piece: Piece) -> None:
        """Take a piece, and hand it to the operating system."""
        if self._file is not None:
            text = json.dumps(piece._asdict(), separators=(",", ":"), default=astuple)
            offset = self._file.seek(0, os.SEEK_END)
            self._file.write(_line(text.encode(), offset))
            self._file.flush()
        self._enter(piece)

    def discard(self) -> None:
        """Remove the file, after its contents were saved or printed."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    def _enter(self, piece: Piece) -> None:
        self.columns.enter(piece.points)
        if self.study.plan.continuation:
            # Of a chain only the newest end is needed, in either direction.
            first, last = piece.points[0].number, piece.points[-1].number
            for neighbour in (first - 1, first + 1):
                self.ends.pop(neighbour, None)
            self.ends[last] = piece.end

    def _read(self, file: BinaryIO) -> None:
        text = _heading(self.study)
        opening, first = _line(text, 0), file.readline()
        if first != opening and opening.startswith(first):
            file.seek(0)
            file.write(opening)
            file.flush()
            return
        self._compare(json.loads(text), first)
        offset = len(first)
        while (line := file.readline()).endswith(b"\n"):
            with self._unchanged(offset):
                piece = self._piece(line, offset)
                indices = [point.number for point in piece.points]
                if not 0 <= min(indices) <= max(indices) < self.study.plan.size:
                    raise ValueError
                if not self.columns.done[indices].any():
                    self._enter(piece)
            offset += len(line)
        file.seek(offset)
        file.truncate()

    def _piece(self, line: bytes, offset: int) -> Piece:
        values = _parsed(line, offset)
        end = None if values["end"] is None else MotionState.from_json(values["end"])
        return Piece([self.study.row(point) for point in values["points"]], end)

    def _compare(self, header: Mapping[str, Any], line: bytes) -> None:
        if not line.startswith(_OPENING):
            raise InvalidInputError(f"{self.path}: {_NO_JOURNAL}")
        if not line.startswith(_OPENING + _VERSION):
            raise InvalidInputError(
                f"{self.path}: is the journal of another version of stickslip_ros; finish the "
                "study with that version, or remove this journal of it"
            )
        with self._unchanged(0):
            differences = ", ".join(_differences(_parsed(line, 0), header))
        if differences:
            raise InvalidInputError(
                f"{self.path}: belongs to another study, which differs in {differences}; finish "
                "that study, or remove this journal of it"
            )

    @contextmanager
    def _unchanged(self, offset: int) -> Generator[None]:
        """Refuse a line that is not as it was written."""
        try:
            yield
        except (ValueError, LookupError, TypeError):
            raise InvalidInputError(
                f"{self.path}: the line at byte {offset} is not as it was written; cut the file "
                f"there, with truncate -s {offset}, to keep the points before it"
            ) from None


def kept_journal(study: PointStudy[Any], columns: Any = None) -> Journal:
    """Return the journal of a study in the user's cache; without a file if that is not to be."""
    name = f"{study.scenario.name}-{sha256(_heading(study)).hexdigest()[:16]}.part"
    try:
        path = user_cache() / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return Journal(study, path, columns)
    except (OSError, RuntimeError, InvalidInputError):  # no home, or the same study runs elsewhere
        return Journal(study, None, columns)


def _heading(study: PointStudy[Any]) -> bytes:
    heading = {"versions": versions(), **study.as_dict(), **study.contents()}
    return _OPENING + _VERSION + b", " + json.dumps(heading).encode()[1:]


def _opened(path: Path) -> BinaryIO:
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NONBLOCK, 0o666)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise InvalidInputError(f"{path}: {_NO_JOURNAL}")
    file = os.fdopen(descriptor, "r+b")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        there = os.path.samestat(os.fstat(descriptor), path.stat())
    except (BlockingIOError, FileNotFoundError):
        there = False
    if not there:  # or the other process has just finished and removed it
        file.close()
        raise InvalidInputError(f"{path}: another process is writing it")
    return file


def _line(text: bytes, offset: int) -> bytes:
    """Return a text as a line that belongs at one offset of the file, with its checksum."""
    return b"%s %08x\n" % (text, crc32(text, offset))


def _parsed(line: bytes, offset: int) -> dict[str, Any]:
    """Return the values of a line; raises ValueError if it is not as it was written."""
    text = line[:-10]
    if line != _line(text, offset):
        raise ValueError
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError from None


def _differences(present: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    """Yield the entries in which the two differ, with both values."""
    for key, other in expected.items():
        one = present.get(key)
        if isinstance(one, dict) and isinstance(other, dict):
            yield from (f"{key}.{text}" for text in _differences(one, other))
        elif one != other and (one == one or other == other):  # nan is as good as nan
            yield f"{key} ({one!r:.60}, not {other!r:.60})"
