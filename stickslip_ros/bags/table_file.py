"""Recordings of machines as tables: CSV files, and MAT files of MATLAB."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.physics.measures.reading import UNKNOWN, Reading
from stickslip_ros.samples import ForceColumns, SampleColumns
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
"""What a table may have of a run; time and position it must have."""

_OWN = {
    "time": ("time",),
    "position": ("measured_position", "position"),
    "velocity": ("measured_velocity", "velocity"),
    "force": ("control_force",),
    "belt_velocity": ("belt_velocity",),
    "friction_force": ("friction_force",),
}
"""Columns of the files that `stickslip simulate --out` writes; the first one that exists."""

_LONGEST = 9e9
"""Longest time, s, that stamps can express."""


@dataclass(frozen=True)
class TableRecording:
    """A recording from a table, in SI units."""

    samples: SampleColumns
    """The motion; time zero is the stamp 0."""
    forces: ForceColumns
    """Control force at each sample; empty if the table has none."""
    reading: Reading
    """How the samples are to be read, as far as the table tells."""
    notes: tuple[str, ...]
    """Sentences on what the table does not have."""


def is_table(path: Path) -> bool:
    """Return whether a path names a table rather than a bag."""
    return path.suffix.lower() in TABLE_SUFFIXES


def read_table(path: Path, columns: Mapping[str, str] | None = None) -> TableRecording:
    r"""Read a recording from a CSV or MAT file.

    A velocity that is not given is the difference of the positions beside each sample. A belt
    whose velocity is not given is at rest.

    Parameters
    ----------
    path : Path
        A CSV file whose first line has the names of its columns, separated by commas, semicolons or
        tabs; or a MAT file, version 7 or older, with a variable for each column.
    columns : mapping, optional
        For each of `QUANTITIES`: the name of a column, a number, or a product of them such as
        `vir*35.15065`; SI units. By default the file is one of `stickslip simulate --out`.

    Returns
    -------
    TableRecording
        Samples and forces.

    Raises
    ------
    BagError
        If the file cannot be read.
    InvalidInputError
        If a column is not there, or the quantities do not make a recording.

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
    return _recording(path, quantities_of(path, table_of(path), columns))


def quantities_of(
    path: Path, table: Mapping[str, FloatArray], columns: Mapping[str, str] | None = None
) -> dict[str, FloatArray]:
    """Return the quantities that a table has, as arrays of shape (rows,).

    Parameters
    ----------
    path : Path
        The file that the table was read from.
    table : mapping
        Its columns, see `table_of`.
    columns : mapping, optional
        As for `read_table`.

    Returns
    -------
    dict
        Values by quantity, SI units, without the rows whose time is not finite.

    Raises
    ------
    InvalidInputError
        If a column is not there, or time or position is not given.
    """
    if columns is None:
        columns = own_columns(path, table)
    for name in columns:
        if name not in QUANTITIES:
            raise InvalidInputError(f"column {name} is refused: {must_be_one_of(name, QUANTITIES)}")
    lacking = [name for name in ("time", "position") if name not in columns]
    if lacking:
        raise InvalidInputError(f"{path}: no column is given for {' and '.join(lacking)}")
    values = {name: _value(path, table, text) for name, text in columns.items()}
    time = values["time"]
    if time.ndim == 0:
        raise InvalidInputError(f"{path}: time = {columns['time']} must be a column")
    known = np.isfinite(time)
    if not known.any():
        raise InvalidInputError(f"{path}: no time is a finite number")
    return {name: np.broadcast_to(each, time.shape)[known] for name, each in values.items()}


def table_of(path: Path) -> dict[str, FloatArray]:
    """Return the columns of a CSV or MAT file, and single numbers, by name; raises BagError."""
    return _read_mat(path) if path.suffix.lower() == ".mat" else _read_csv(path)


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
    since = time - time[0]
    if np.abs(since).max() > _LONGEST:
        raise InvalidInputError(f"{path}: the times differ by more than {_LONGEST:g} s")
    return np.rint(since * NANOSECONDS).astype(np.int64)


def _recording(path: Path, found: Mapping[str, FloatArray]) -> TableRecording:
    time = found["time"] - found["time"][0]
    stamp = stamps_of(path, time)
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
    # Differences of positions never have exactly the speed of the belt.
    reading = UNKNOWN if velocity is not None else Reading(noisy=True)
    return TableRecording(samples, forces, reading, tuple(notes))


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
        for quantity, names in _OWN.items()
    }
    if not own["time"] or not own["position"]:
        raise InvalidInputError(
            f"{path} has the columns {', '.join(table)}, and not those of `stickslip simulate "
            "--out`: say what they are, as in --columns time=t,position=x,force=u*2.5"
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
            known = f"has {', '.join(table)}"
            hint = did_you_mean(factor, table, known)
            raise InvalidInputError(f"{path} has no column {shown(factor)}; {hint}")
    return value


def _read_csv(path: Path) -> dict[str, FloatArray]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            heading, rest = file.readline(), file.readline()
        if not heading:
            raise BagError(f"{path}: the file is empty")
        if not rest:
            raise BagError(f"{path}: the file has no rows")
        separator = max(",;\t", key=heading.count)
        names = [name.strip() for name in next(csv.reader([heading], delimiter=separator), [])]
        if len(names) < 2 or len({*names}) < len(names):
            raise BagError(
                f"{path}: the first line must have the names of the columns, all different"
            )
        options: Any = {"delimiter": separator, "encoding": "utf-8-sig", "comments": None}
        try:
            rows = np.loadtxt(path, skiprows=1, ndmin=2, **options)
        except ValueError:  # it has empty cells, which take ten times as long
            rows = np.genfromtxt(path, skip_header=1, **options)
            rows = rows.reshape(-1, rows.shape[-1] if rows.ndim > 1 else max(rows.size, 1))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error).strip().partition("\n")[0]
        raise BagError(f"{path}: the file cannot be read: {reason}") from None
    if rows.shape[1] != len(names):
        raise BagError(f"{path} has {rows.shape[1]} columns and {len(names)} names for them")
    return dict(zip(names, rows.T.copy(), strict=True))


def _read_mat(path: Path) -> dict[str, FloatArray]:
    from scipy.io import loadmat  # takes as long to import as a small report

    try:
        with path.open("rb") as file:
            found: Any = loadmat(file, squeeze_me=True)
    except NotImplementedError:
        raise BagError(
            f"{path}: a MAT file of version 7.3 is refused: save it with the option -v7"
        ) from None
    except Exception as error:
        reason = getattr(error, "strerror", None) or str(error).strip().partition("\n")[0]
        raise BagError(f"{path}: the file cannot be read: {reason}") from None
    table = {
        name: np.atleast_1d(np.asarray(values)).astype(float)
        for name, values in cast(dict[str, Any], found).items()
        if not name.startswith("__") and np.asarray(values).dtype.kind in "biuf"
    }
    columns = {name: values for name, values in table.items() if values.ndim == 1}
    length = max((len(values) for values in columns.values()), default=0)
    # A single number is a constant, such as the gain of an amplifier.
    return {
        name: values if len(values) == length else values.reshape(())
        for name, values in columns.items()
        if len(values) in (1, length)
    }
