"""Recordings of machines as tables: CSV files, and files of other tools."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import open_regular
from stickslip_ros.record.bag_formats import OTHER_BAGS
from stickslip_ros.record.faults import differences
from stickslip_ros.record.reader import RunBlock
from stickslip_ros.record.table_clock import stamps_of
from stickslip_ros.record.table_columns import ANY_FORM, SECOND, Table, TableFormat, reading_file
from stickslip_ros.record.table_formats import format_of, read_foreign
from stickslip_ros.record.table_quantities import Quantities, quantities_of
from stickslip_ros.record.text_table import TextTable
from stickslip_ros.samples import NO_FORCES, ForceColumns, ReferenceColumns, SampleColumns

TABLE_SUFFIXES = (
    ".csv", ".mat", ".txt", ".dat", ".tsv", ".log", ".asc", ".xlsx", ".parquet", ".tdms", ".npz"
)  # fmt: skip
"""Ends of the names of files that are tables, whatever they hold."""

_OTHERS = {
    b"\xd0\xcf\x11\xe0": "an old workbook of Excel: save it as .xlsx",
    b"RIFF": "sound: read it with scipy.io.wavfile, and save it by scipy.io.savemat",
    ".svdx": "a project of TwinCAT Scope, which exports it as CSV",
}
"""What other files are, by their first bytes or end, and how they become tables."""
_BAG_SUFFIXES = (".mcap", ".db3", ".bag")
_START = 16
"""First bytes that tell a format."""
_MCAP = b"\x89MCAP"

_MOST_NUMBERS = 1 << 24
"""Numbers of a file of vectors."""


class VectorTable(Table):
    """The vectors of a file, such as a MAT file."""

    def __init__(
        self, path: Path, form: TableFormat, vectors: Mapping[str, tuple[str, FloatArray]]
    ) -> None:
        """Take units and vectors by name."""
        self.path, self.form, self.names = path, form, [*vectors]
        self.units, self._vectors = zip(*vectors.values(), strict=True)
        self.columns = {name: place for place, name in enumerate(vectors)}
        self._rows: IntArray | None = None

    def read(self, places: Sequence[int]) -> list[FloatArray]:
        """Return vectors by their places, or the rows of them that are wanted."""
        if self.wanted is None:
            return [self._vectors[place] for place in places]
        column, _, number = self.wanted
        values = self._vectors[column]
        self._rows = np.flatnonzero(values == number)
        if not len(self._rows):
            raise self.nothing_where(column, (f"{present:g}" for present in np.unique(values)))
        vectors = [self._vectors[place] for place in places]
        return [vector[self._rows] if len(vector) == len(values) else vector for vector in vectors]

    def line(self, row: int) -> str:
        """Return the number of a row, for a message."""
        return f"row {row + 1 if self._rows is None else self._rows[row] + 1}"


class JoinedTable(Table):
    """A table, and a second one whose columns have `2:` before their names, as in `2:F`."""

    def __init__(self, first: Table, second: Table) -> None:
        """Take both tables."""
        self.path, self.form = first.path, first.form
        self.period, self.turns = first.period, first.turns
        self.remarks = [*first.remarks, *second.remarks]
        self._tables = first, second
        self.second_from = self._width = len(first.names)
        self.names, self.units = [*first.names, *second.names], [*first.units, *second.units]
        later = {f"{SECOND}{name}": self._width + place for name, place in second.columns.items()}
        self.columns = {**first.columns, **later}

    @property
    @override
    def notes(self) -> Sequence[str]:
        first, second = self._tables
        return [*first.notes, *(f"{second.path.name}: {note}" for note in second.notes)]

    @override
    def read(self, places: Sequence[int]) -> list[Any]:
        """Return columns, which have the lengths of their tables; times of both have one zero."""
        columns, clocks, starts = dict[int, Any](), set[int](), list[tuple[str, int] | None]()
        for table, offset in zip(self._tables, (0, self._width), strict=True):
            used = [place for place in places if (place < self._width) == (offset == 0)]
            values = table.read([place - offset for place in used]) if used else []
            columns |= dict(zip(used, values, strict=True))
            clocks |= {place + offset for place in table.clocks}
            starts.append(table.start)
        first, second = starts
        for place in clocks:
            if place >= self._width and first and second and first[0] == second[0]:
                columns[place] = columns[place] + (second[1] - first[1]) / 1e9
        self.clocks = clocks
        return [columns[place] for place in places]

    @override
    def line(self, row: int) -> str:
        return self._tables[0].line(row)


def is_table(path: Path) -> bool:
    """Return whether a path names a table rather than a bag: by its end or its first bytes."""
    if path.suffix.lower() in TABLE_SUFFIXES:
        return True
    if not path.is_file() or any(suffix in _BAG_SUFFIXES for suffix in path.suffixes):
        return False
    with reading_file(path), open_regular(path) as stream:
        return not stream.read(_START).startswith((_MCAP, *OTHER_BAGS))


def table_of(path: Path, form: TableFormat = ANY_FORM) -> Table:
    """Return the table in a text, or in a file of another tool; raises BagError.

    If a second one is given, both are joined.
    """
    if form.second is not None:
        first, second = replace(form, second=None), replace(form, second=None, where=None)
        return JoinedTable(table_of(path, first), table_of(form.second, second))
    with reading_file(path), open_regular(path) as stream:
        start = os.pread(stream.fileno(), _START, 0)
        for sign, what in _OTHERS.items():
            if sign in (path.suffix.lower(), start[: len(sign)]):
                raise ValueError(f"it is {what}")
        foreign = format_of(start, path.suffix.lower())
        if foreign is None:
            return TextTable(path, form)
        content, notes = read_foreign(stream, foreign, _MOST_NUMBERS)
        if isinstance(content, bytes):
            return TextTable(path, form, content, notes)
        if not content:
            raise ValueError("it has no column")
        return VectorTable(path, form, content)


@dataclass(frozen=True)
class TableRecording:
    """A recording from a table, in SI units; it is read as a `Recording` is, in one block."""

    samples: SampleColumns
    """The motion; time zero is the stamp 0."""
    forces: ForceColumns
    """Control force at each sample; empty if the table has none."""
    references: ReferenceColumns
    """Reference at each sample, without velocities; empty if the table has none."""
    velocity_estimated: bool
    """Whether the velocities are estimated from the positions."""
    notes: tuple[str, ...]
    """Sentences on what the table does not have."""
    missing = ()
    """A table that can be read is complete."""
    dropped_known = False
    """A table does not tell which forces did not act."""

    def blocks(self, least: int = 1) -> Iterator[RunBlock]:
        """Yield samples, forces and no dropped forces, as recorded by another machine."""
        yield RunBlock(self.samples, self.forces, self.forces[:0], True, self.velocity_estimated)

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return None: a table has no metadata."""
        return None


def read_table(
    path: Path,
    columns: Mapping[str, str] | None = None,
    belt_speed: float | None = None,
    form: TableFormat = ANY_FORM,
) -> TableRecording:
    r"""Read a recording from a table: a text such as a CSV file, or a MAT file.

    `columns` has, for some of `QUANTITIES`, an `Expression` of columns and numbers in SI units.
    What has no number in it is converted, if the table has its unit. By default the file is one of
    `stickslip simulate --out`. A `belt_speed` is in place of a column. A velocity that is not given
    is the difference of the positions beside each sample. A belt whose velocity is not given is at
    rest. `form` is what is known of the form of a text.
    """
    return _recording(path, quantities_of(table_of(path, form), columns, belt_speed))


def _recording(path: Path, quantities: Quantities) -> TableRecording:
    values, notes = quantities.values, [*quantities.notes]
    time, position = values["time"], values["position"]
    stamp = stamps_of(path, time)
    present = np.isfinite(position)
    unknown, rest = np.full(len(time), nan), np.zeros(len(time))
    velocity = values.get("velocity", unknown)
    lacking = present & ~np.isfinite(velocity)
    if "velocity" not in values:
        notes.append("the velocity is not recorded: it is the difference of the positions")
    elif lacking.any():
        notes.append(
            f"{np.count_nonzero(lacking)} rows have a position and no velocity: it is the "
            "difference of the positions"
        )
    if "belt_velocity" not in values:
        notes.append("the belt velocity is not recorded: the belt counts as at rest")
    if lacking.all():
        velocity = differences(time, position)
    elif lacking.any():
        by_position = np.full(len(time), nan)
        by_position[present] = differences(time[present], position[present])
        velocity = np.where(lacking, by_position, velocity)
    samples = SampleColumns(
        stamp,
        position,
        velocity,
        values.get("friction_force", unknown),
        unknown,
        values.get("belt_velocity", rest),
    )
    if not samples.is_valid.any():
        empty = [name for name, value in values.items() if not np.isfinite(value[present]).any()]
        raise InvalidInputError(
            f"{path}: no row gives a sample: no position has a number of "
            f"{' and '.join(empty) or 'velocity, for the times stand,'} beside it"
        )
    forces = ForceColumns(stamp, values["force"]) if "force" in values else NO_FORCES
    references = ReferenceColumns(stamp, values.get("reference", unknown), unknown)
    estimated = 2 * np.count_nonzero(lacking) > np.count_nonzero(present)
    if "reference" not in values:
        references = references[:0]
    return TableRecording(samples, forces, references, bool(estimated), tuple(notes))
