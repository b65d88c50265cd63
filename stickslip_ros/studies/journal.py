"""Journals: the computed points of a study on disk, from which an interrupted study continues."""

import fcntl
import json
import os
import stat
from array import array
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import astuple
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryFile
from types import TracebackType
from typing import Any, BinaryIO, Self
from zlib import crc32

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.studies.settling import MotionState
from stickslip_ros.studies.study import Piece, Point, Study
from stickslip_ros.versions import versions

_OPENING, _VERSION = b'{"format": "stickslip_ros study ', b'2"'
_NO_JOURNAL = "exists already, and is not the journal of a study"


class Journal:
    """The computed points of a study, in a file of lines; a context manager.

    The first line describes the study, and each further line holds a piece; both are JSON, and a
    checksum of it and of its place. An unfinished last line, of a writer that was killed, is
    removed. Memory holds one bit for each point and two numbers for each piece.

    Examples
    --------
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> from stickslip_ros.studies.plan import Axis
    >>> from stickslip_ros.studies.runner import run
    >>> from stickslip_ros.studies.sweep import sweep_study
    >>> scenario = load_scenario("paper", ["plant.expects_control=false"])
    >>> study = sweep_study(scenario, [Axis("plant.belt_speed", 0.2, 0.6, 2)])
    >>> with Journal(study) as journal:
    ...     run(journal)
    ...     print([str(point.measures.regime) for point in journal.points()])
    ['stick_slip', 'equilibrium']
    """

    def __init__(self, study: Study, path: Path | None = None) -> None:
        """Start a journal, or continue the one that exists.

        Parameters
        ----------
        study : Study
            The study whose points it holds.
        path : Path, optional
            The file; without a path it is a temporary one.

        Raises
        ------
        InvalidInputError
            If the file is not a journal of this study or has been changed, another process writes
            it, or it cannot be written.
        """
        self.study = study
        """The study."""
        self.count = 0
        """Number of points that are done."""
        self._done = bytearray((study.plan.size + 7) // 8)
        self._firsts, self._offsets = array("Q"), array("Q")
        self._ends: dict[int, MotionState | None] = {}
        self.path = path
        """The file; None for a temporary one."""
        try:
            self._file = _opened(path)
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be written: {error.strerror}") from None
        try:
            self._read()
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
            self._file.close()
        except OSError:  # the same failure to write again
            if error is None:
                raise

    def is_done(self, index: int) -> bool:
        """Return whether a point is done.

        Parameters
        ----------
        index : int
            Index of the point in the plan, from 0.

        Returns
        -------
        bool
            Whether the journal holds the point.
        """
        return bool(self._done[index >> 3] & 1 << (index & 7))

    def state_after(self, index: int) -> MotionState | None:
        """Return the state in which the newest point of a chain ended.

        Parameters
        ----------
        index : int
            Index of that point in the plan.

        Returns
        -------
        MotionState or None
            The state; None if the motion failed or diverged.
        """
        return self._ends[index]

    def add(self, piece: Piece) -> None:
        """Append a piece and hand it to the operating system.

        Parameters
        ----------
        piece : Piece
            The computed points.
        """
        end = None if piece.end is None else astuple(piece.end)
        line = {"points": [point.as_json() for point in piece.points], "end": end}
        self._file.seek(0, os.SEEK_END)
        offset = self._file.tell()
        self._file.write(_line(json.dumps(line, separators=(",", ":")).encode(), offset))
        self._file.flush()
        self._enter(offset, [point.number for point in piece.points], piece.end)

    def points(self) -> Iterator[Point]:
        """Yield the points that are done, in order of their index."""
        for line in np.argsort(self._firsts):
            offset = self._offsets[line]
            self._file.seek(offset)
            with self._unchanged(offset):
                found = _piece(self._file.readline(), offset).points
            yield from sorted(found, key=lambda point: point.number)

    def discard(self) -> None:
        """Remove the file, after its contents were saved or printed."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    def _enter(self, offset: int, indices: Sequence[int], end: MotionState | None) -> None:
        for index in indices:
            self._done[index >> 3] |= 1 << (index & 7)
        self.count += len(indices)
        self._firsts.append(min(indices))
        self._offsets.append(offset)
        if self.study.plan.continuation:
            # Of a chain only the newest end is needed, in either direction.
            for neighbour in (indices[0] - 1, indices[0] + 1):
                self._ends.pop(neighbour, None)
            self._ends[indices[-1]] = end

    def _read(self) -> None:
        text = _heading(self.study)
        opening, first = _line(text, 0), self._file.readline()
        if first != opening and opening.startswith(first):
            self._file.seek(0)
            self._file.write(opening)
            self._file.flush()
            return
        self._compare(json.loads(text), first)
        offset = len(first)
        while (line := self._file.readline()).endswith(b"\n"):
            with self._unchanged(offset):
                piece = _piece(line, offset)
                indices = [point.number for point in piece.points]
                if not 0 <= min(indices) <= max(indices) < self.study.plan.size:
                    raise ValueError
                if not any(self.is_done(index) for index in indices):
                    self._enter(offset, indices, piece.end)
            offset += len(line)
        self._file.seek(offset)
        self._file.truncate()

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


def kept_journal(study: Study) -> Journal:
    """Return the journal of a study in the user's cache; a temporary one if that is not to be."""
    name = f"{study.scenario.name}-{sha256(_heading(study)).hexdigest()[:16]}.part"
    try:
        cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        path = Path(cache, "stickslip_ros", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        return Journal(study, path)
    except (OSError, RuntimeError, InvalidInputError):  # no home, or the same study runs elsewhere
        return Journal(study)


def _heading(study: Study) -> bytes:
    heading = {"versions": versions(), **study.as_dict(), **study.contents()}
    return _OPENING + _VERSION + b", " + json.dumps(heading).encode()[1:]


def _opened(path: Path | None) -> BinaryIO:
    if path is None:
        return TemporaryFile()
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


def _piece(line: bytes, offset: int) -> Piece:
    values = _parsed(line, offset)
    end = None if values["end"] is None else MotionState.from_json(values["end"])
    return Piece([Point.from_json(each) for each in values["points"]], end)


def _differences(found: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    """Yield the entries in which the two differ, with both values."""
    for key, other in expected.items():
        one = found.get(key)
        if isinstance(one, dict) and isinstance(other, dict):
            yield from (f"{key}.{text}" for text in _differences(one, other))
        elif one != other and (one == one or other == other):  # nan is as good as nan
            yield f"{key} ({one!r:.60}, not {other!r:.60})"
