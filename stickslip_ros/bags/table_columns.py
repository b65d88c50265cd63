"""The columns of a table in a file: a text, or a MAT file of MATLAB."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stickslip_ros.bags.expressions import Expression, listed
from stickslip_ros.bags.mat_file import is_mat, vectors_of
from stickslip_ros.bags.text_table import ANY_FORM, TableFormat, TextTable
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.files import open_regular

TABLE_SUFFIXES = (".csv", ".mat", ".txt", ".dat", ".tsv", ".log", ".asc")
"""Ends of the names of files that are tables, whatever they hold."""

_BAG_SUFFIXES = (".mcap", ".db3")
_MCAP = b"\x89MCAP"

_OWN_COLUMNS = {
    "time": ("time",),
    "position": ("measured_position", "position"),
    "velocity": ("measured_velocity", "velocity"),
    "force": ("control_force",),
    "belt_velocity": ("belt_velocity",),
    "friction_force": ("friction_force",),
}
"""Columns of the files that `stickslip simulate --out` writes; the first one that exists."""

_MOST_NUMBERS = 1 << 24
"""Numbers of a MAT file."""


def is_table(path: Path) -> bool:
    """Return whether a path names a table rather than a bag: by its end or its first bytes."""
    if path.suffix.lower() in TABLE_SUFFIXES:
        return True
    if not path.is_file() or any(each in _BAG_SUFFIXES for each in path.suffixes):
        return False
    with reading_file(path), open_regular(path) as stream:
        return not stream.read(len(_MCAP)).startswith(_MCAP)


@dataclass(frozen=True)
class Table:
    """A table of a file: what its columns are, and how they are read."""

    path: Path
    columns: Mapping[str, int]
    """Places of the columns by name; a column has several names, such as `x` and `#2`."""
    names: Sequence[str]
    """Name of each column; empty if it has none."""
    units: Sequence[str]
    """Units that the table has for its columns; empty where it has none."""
    read: Callable[[Sequence[int]], list[Any]]
    """Read columns by their places, as arrays of shape (rows,), or of a constant (1,)."""
    line: Callable[[int], str]
    """Name the place of a row in the file."""
    notes: Callable[[], Sequence[str]]
    """Return sentences on how the file was read."""

    def has(self, text: str) -> bool:
        """Return whether the table has all columns of an expression."""
        try:
            Expression.read(self.path, text, self.columns)
        except InvalidInputError:
            return False
        return True

    def name(self, place: int) -> str:
        """Return the name of a column for a message."""
        names = (name for name, each in self.columns.items() if each == place and name[:1] != "#")
        return f"column {next(names, f'#{place + 1}')}"

    @property
    def own_columns(self) -> dict[str, str]:
        """Columns by quantity of a table that `stickslip simulate --out` has written.

        Raises InvalidInputError for another one.
        """
        own = {
            quantity: next((name for name in names if name in self.columns), "")
            for quantity, names in _OWN_COLUMNS.items()
        }
        if not own["time"] or not own["position"]:
            raise InvalidInputError(
                f"{self.path} has the columns {listed(self.columns)}, and not those of "
                "`stickslip simulate --out`: say what they are, as in --columns "
                "time=t,position=x,force=u*2.5"
            )
        return {quantity: name for quantity, name in own.items() if name}


def table_of(path: Path, form: TableFormat = ANY_FORM) -> Table:
    """Return the table in a text or MAT file; raises BagError."""
    with reading_file(path):
        with open_regular(path) as stream:
            if is_mat(path, stream):
                found = vectors_of(stream, _MOST_NUMBERS)
                if not found:
                    raise ValueError("it has no column")
                vectors = [*found.values()]
                return Table(
                    path,
                    {name: place for place, name in enumerate(found)},
                    [*found],
                    [""] * len(found),
                    lambda wanted: [vectors[place] for place in wanted],
                    lambda row: f"row {row + 1}",
                    lambda: (),
                )
        text = TextTable(path, form)
        return Table(
            path,
            text.columns,
            text.names,
            text.units,
            text.read,
            text.line,
            lambda: text.notes,
        )


@contextmanager
def reading_file(path: Path) -> Generator[None]:
    """Turn what a file raises that cannot be read into BagError."""
    try:
        yield
    except (OSError, ValueError, OverflowError, MemoryError) as error:
        if isinstance(error, InvalidInputError):
            raise
        reason = getattr(error, "strerror", None) or str(error).strip() or type(error).__name__
        raise BagError(f"{path}: the file cannot be read: {reason}") from None
