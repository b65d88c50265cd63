"""Recordings of machines as tables: CSV files, and MAT files of MATLAB."""

import csv
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from io import TextIOWrapper
from itertools import islice
from math import nan
from pathlib import Path
from typing import BinaryIO

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.bags.compression import LARGEST as LARGEST_FILE
from stickslip_ros.bags.mat_file import vectors_of
from stickslip_ros.bags.reader import RunBlock
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.files import open_regular
from stickslip_ros.samples import LARGEST, ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import did_you_mean, must_be_one_of, shown

TABLE_SUFFIXES = (".csv", ".mat")
"""Ends of the names of files that are tables."""

QUANTITIES = (
    "time",
    "position",
    "velocity",
    "force",
    "belt_velocity",
    "friction_force",
    "disturbance",
    "reference",
)
"""Quantities of a run that a table may have; time and position it must have."""

LONGEST = 9e9
"""Longest time, s, that stamps can express."""

_OWN_COLUMNS = {
    "time": ("time",),
    "position": ("measured_position", "position"),
    "velocity": ("measured_velocity", "velocity"),
    "force": ("control_force",),
    "belt_velocity": ("belt_velocity",),
    "friction_force": ("friction_force",),
}
"""Columns of the files that `stickslip simulate --out` writes; the first one that exists."""

_MOST_NUMBERS, _MOST_COLUMNS, _LONGEST_LINE = 1 << 24, 10_000, 1 << 20
"""Numbers and columns of a table, and characters of a line, that are read."""

_LONGEST_LIST = 1000
"""Characters of the longest list of columns in a message."""


@dataclass(frozen=True)
class TableRecording:
    """A recording from a table, in SI units; it is read as a `Recording` is, in one block."""

    samples: SampleColumns
    """The motion; time zero is the stamp 0."""
    forces: ForceColumns
    """Control force at each sample; empty if the table has none."""
    velocity_estimated: bool
    """Whether the velocities are estimated from the positions."""
    notes: tuple[str, ...]
    """Sentences on what the table does not have."""
    dropped_known = False
    """A table does not tell which forces did not act."""

    @property
    def topics(self) -> dict[str, str]:
        """A table has none."""
        return {}

    @property
    def missing(self) -> list[str]:
        """A table that can be read is complete."""
        return []

    def blocks(self, least: int = 1) -> Iterator[RunBlock]:
        """Yield the samples, the forces and no dropped forces."""
        yield RunBlock(self.samples, self.forces, self.forces[:0])

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return None: a table has no metadata."""
        return None


def is_table(path: Path) -> bool:
    """Return whether a path names a table rather than a bag."""
    return path.suffix.lower() in TABLE_SUFFIXES


def read_table(
    path: Path, columns: Mapping[str, str] | None = None, belt_speed: float | None = None
) -> TableRecording:
    r"""Read a recording from a CSV or MAT file.

    A CSV file begins with the names of its columns, separated by commas, semicolons or tabs; a MAT
    file, version 7 or older, has a variable for each column. `columns` has, for some of
    `QUANTITIES`, the name of a column, a number, or a product of them such as `vir*35.15065`, in SI
    units; by default the file is one of `stickslip simulate --out`. A `belt_speed` is in place of a
    column. A velocity that is not given is the difference of the positions beside each sample. A
    belt whose velocity is not given is at rest.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from stickslip_ros.bags.table_file import read_table
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "log.csv")
    ...     _ = path.write_text("t;x\n0;1\n0.001;3\n")
    ...     recording = read_table(path, {"time": "t", "position": "x*1e-6"})
    >>> recording.samples.position.tolist()
    [1e-06, 3e-06]
    """
    return _recording(path, quantities_of(path, table_of(path), columns, belt_speed))


def quantities_of(
    path: Path,
    table: Mapping[str, FloatArray],
    columns: Mapping[str, str] | None = None,
    belt_speed: float | None = None,
) -> dict[str, FloatArray]:
    """Return the quantities that a table of the file `path` has, as arrays of shape (rows,).

    The arguments are those of `read_table`. Rows whose time is not finite are left out. Values
    that a measure would overflow with are NaN (above 1e100) or zero (below 1e-100).
    """
    if columns is None:
        columns = own_columns(path, table)
    if belt_speed is not None:
        columns = {**columns, "belt_velocity": repr(float(belt_speed))}
    for name in columns:
        if name not in QUANTITIES:
            raise InvalidInputError(f"column {name} is refused: {must_be_one_of(name, QUANTITIES)}")
    lacking = [name for name in ("time", "position") if name not in columns]
    if lacking:
        raise InvalidInputError(f"{path}: no column is given for {' and '.join(lacking)}")
    with np.errstate(over="ignore", invalid="ignore"):
        values = {name: _value(path, table, text) for name, text in columns.items()}
    time = values["time"]
    if time.ndim == 0:
        raise InvalidInputError(f"{path}: time = {columns['time']} must be a column")
    known = np.isfinite(time)
    if not known.any():
        raise InvalidInputError(f"{path}: no time is a finite number")
    for name, each in values.items():
        if name != "time":
            size = np.abs(each)
            each = np.where(size <= LARGEST, each, nan) * (size >= 1.0 / LARGEST)
        values[name] = np.broadcast_to(each, time.shape)[known]
    return values


def table_of(path: Path) -> dict[str, FloatArray]:
    """Return the columns of a CSV or MAT file, and single numbers, by name; raises BagError."""
    try:
        with open_regular(path) as stream:
            if os.fstat(stream.fileno()).st_size > LARGEST_FILE:
                raise ValueError(f"it has more than {LARGEST_FILE} bytes")
            if path.suffix.lower() == ".mat":
                return _read_mat(stream)
            with TextIOWrapper(stream, encoding="utf-8-sig") as file:
                return _read_csv(file)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error).strip().partition(";")[0]
        raise BagError(f"{path}: the file cannot be read: {reason}") from None


def has_columns(table: Mapping[str, FloatArray], text: str) -> bool:
    """Return whether a table has all columns of a product such as `vir*35.15065`."""
    return all(factor in table or _is_number(factor) for factor in _factors(text))


def _factors(text: str) -> list[str]:
    return [part.strip() for part in text.split("*")]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def stamps_of(path: Path, time: FloatArray) -> IntArray:
    """Return times, s, as stamps, ns, from the first one; InvalidInputError if they are too far."""
    with np.errstate(over="ignore"):
        since = time - time[0]
    if np.abs(since).max() > LONGEST:
        raise InvalidInputError(f"{path}: the times differ by more than {LONGEST:g} s")
    return np.rint(since * NANOSECONDS).astype(np.int64)


def _recording(path: Path, found: Mapping[str, FloatArray]) -> TableRecording:
    stamp = stamps_of(path, found["time"])
    time = found["time"] - found["time"][0]
    notes: list[str] = []
    position = found["position"]
    if "velocity" not in found:
        notes.append("the velocity is not recorded: it is the difference of the positions")
    if "belt_velocity" not in found:
        notes.append("the belt velocity is not recorded: the belt counts as at rest")
    velocity = found.get("velocity")
    unknown, rest = np.full(len(time), np.nan), np.zeros(len(time))
    samples = SampleColumns(
        stamp,
        position,
        _differences(time, position) if velocity is None else velocity,
        found.get("friction_force", unknown),
        unknown,
        found.get("belt_velocity", rest),
    )
    forces = ForceColumns(stamp[:0], rest[:0])
    if "force" in found:
        forces = ForceColumns(stamp, found["force"])
    return TableRecording(samples, forces, velocity is None, tuple(notes))


def _differences(time: FloatArray, position: FloatArray) -> FloatArray:
    """Return the velocity at each time, by the positions on both sides; NaN where time stands."""
    if len(time) < 2:
        return np.zeros(len(time))
    after = np.minimum(np.arange(len(time)) + 1, len(time) - 1)
    before = np.maximum(np.arange(len(time)) - 1, 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return (position[after] - position[before]) / (time[after] - time[before])


def own_columns(path: Path, table: Mapping[str, FloatArray]) -> dict[str, str]:
    """Return the columns by quantity of a table that `stickslip simulate --out` has written.

    Raises InvalidInputError for another one.
    """
    own = {
        quantity: next((name for name in names if name in table), "")
        for quantity, names in _OWN_COLUMNS.items()
    }
    if not own["time"] or not own["position"]:
        raise InvalidInputError(
            f"{path} has the columns {', '.join(table)[:_LONGEST_LIST]}, and not those of "
            "`stickslip simulate --out`: say what they are, as in --columns "
            "time=t,position=x,force=u*2.5"
        )
    return {quantity: name for quantity, name in own.items() if name}


def _value(path: Path, table: Mapping[str, FloatArray], text: str) -> FloatArray:
    """Return a product of columns and numbers."""
    value: FloatArray = np.ones(())
    for factor in _factors(text):
        if factor in table:
            value = value * table[factor]
        elif _is_number(factor):
            value = value * float(factor)
        else:
            known = f"has {', '.join(table)[:_LONGEST_LIST]}"
            hint = did_you_mean(factor, table, known)
            raise InvalidInputError(f"{path} has no column {shown(factor)}; {hint}")
    return value


def _read_csv(file: TextIOWrapper) -> dict[str, FloatArray]:
    def lines() -> Iterator[str]:
        """Return all lines that are not empty; of one that is too long a part."""
        file.seek(0)
        return filter(str.strip, iter(partial(file.readline, _LONGEST_LINE), ""))

    heading, first, *_ = *islice(lines(), 2), "", ""
    if not first:
        raise ValueError("it has no rows" if heading else "it is empty")
    separator = max(",;\t", key=heading.count)
    names = [name.strip() for name in next(csv.reader([heading], delimiter=separator), [])]
    if not 2 <= len(names) <= _MOST_COLUMNS or len({*names}) < len(names):
        raise ValueError(
            f"its first line must have the names of 2 to {_MOST_COLUMNS} columns, all different"
        )
    if (count := first.count(separator) + 1) != len(names):
        raise ValueError(f"it has {count} columns and {len(names)} names for them")
    load = partial(np.loadtxt, delimiter=separator, comments=None, ndmin=2)
    most = _MOST_NUMBERS // len(names)
    rows = lines()
    try:
        table = load(islice(rows, 1, most + 1))
    except ValueError:  # some cells are no numbers: that takes longer
        rows = lines()
        table = load(islice(rows, 1, most + 1), converters=_number)
    if next(rows, None) is not None:
        raise ValueError(f"it has more than {_MOST_NUMBERS} numbers")
    return dict(zip(names, table.T.copy(), strict=True))


def _number(cell: str) -> float:
    """Return the number in a cell, NaN if there is none."""
    try:
        return float(cell)
    except ValueError:
        return nan


def _read_mat(stream: BinaryIO) -> dict[str, FloatArray]:
    columns = vectors_of(stream, _MOST_NUMBERS)
    if not columns:
        raise ValueError("it has no column")
    length = max(map(len, columns.values()))
    # A single number is a constant, such as the gain of an amplifier.
    return {
        name: values if len(values) == length else values.reshape(())
        for name, values in columns.items()
        if len(values) in (1, length)
    }
