"""The columns of a table in a file, whatever its format."""

import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import filterfalse
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.record.expressions import Expression, listed
from stickslip_ros.record.header_units import force_per_ampere
from stickslip_ros.text import shown

_OWN_COLUMNS = {
    "time": ("time",),
    "position": ("measured_position", "position"),
    "velocity": ("measured_velocity", "velocity"),
    "force": ("control_force",),
    "belt_velocity": ("belt_velocity",),
    "friction_force": ("friction_force",),
    "reference": ("reference",),
}
"""Columns of the files that `stickslip simulate --out` writes; the first one that exists."""

SECOND = "2:"
"""What comes before the name or number of a column of a second table."""
_NUMBERED = re.compile(rf"(?:{SECOND})?#\d+$")
ROW = -1
"""Place of the number of a row, which every table has."""


@dataclass(frozen=True)
class TableFormat:
    """What is known of the form of a table; what is None is found from the table."""

    decimal: str | None = None
    """Decimal mark of a text, a point or a comma."""
    skip: int | None = None
    """Number of lines of a text before the names or, without names, the rows."""
    encoding: str | None = None
    """Encoding of a text, as Python names them."""
    rotary: bool = False
    """Whether displacements are angles, and forces torques."""
    period: float | None = None
    """Time from row to row, s, of a table without times."""
    where: str | None = None
    """Column and value of the rows that are read, as in `joint=elbow`."""
    session: int | None = None
    """Which one of the sessions is read; each starts where the time does again."""
    second: Path | None = None
    """Another table of the same run: its columns are `2:NAME`, and it has a clock of its own."""
    shift: float = 0.0
    """What is added to times of their own that columns have, s."""
    force_constant: str | None = None
    """Force or torque constant of the motor, with its unit: the force is a current."""
    pitch: float | None = None
    """Way of the slide in a turn of the motor, m."""

    def __post_init__(self) -> None:
        """Refuse what no table has."""
        for name, allowed, valid in (
            ("decimal", ". or ,", self.decimal in (None, ".", ",")),
            ("skip", "at least 0", (self.skip or 0) >= 0),
            ("period", "above 0 s", self.period is None or 0.0 < self.period < inf),
            ("session", "at least 1", self.session is None or self.session >= 1),
            ("shift", "a finite number, s", isfinite(self.shift)),
            ("pitch", "above 0 m", self.pitch is None or 0.0 < self.pitch < inf),
        ):
            if not valid:
                value = shown(getattr(self, name))
                raise InvalidInputError(f"{name} = {value} is invalid: must be {allowed}")
        if self.pitch is not None and self.force_constant is None:
            raise InvalidInputError(f"pitch = {self.pitch} is refused: it is for a force_constant")
        _ = self.per_ampere
        try:
            "1".encode(self.encoding or "utf-8").decode(self.encoding or "utf-8")
        except (LookupError, ValueError):
            raise InvalidInputError(
                f"encoding = {shown(self.encoding)} is invalid: must be one of Python's, such as "
                "utf-8, utf-16, cp1252"
            ) from None

    @property
    def per_ampere(self) -> float | None:
        """Force, N, of a rotary axis torque, N m, of 1 A; None where the force is no current."""
        if self.force_constant is None:
            return None
        return force_per_ampere(self.force_constant, self.pitch, rotary=self.rotary)


ANY_FORM = TableFormat()
"""Nothing is known of the form."""


class Table(ABC):
    """A table of a file: what its columns are, and how they are read."""

    path: Path
    form: TableFormat
    """What is known of its form."""
    columns: Mapping[str, int]
    """Places of the columns by name; a column has several names, such as `x` and `#2`."""
    names: Sequence[str]
    """Name of each column; empty if it has none."""
    units: Sequence[str]
    """Cells of the columns in a line of units; empty without one."""
    clocks: Collection[int] = ()
    """Places of the columns that are dates or times of day, once they are read: they are in s."""
    second_from: int | None = None
    """Place of the first column of a second table, which has times of its own."""
    start: tuple[str, int] | None = None
    """Their kind, as numpy has it, and the first of them, ns."""
    period: tuple[float, float] | None = None
    """Period of the rows that a line above them tells, s and in its own unit."""
    turns: tuple[int, Sequence[str]] | None = None
    """A column whose values take turns in the first rows, as names of joints do, and the values."""
    remarks: Sequence[str] = ()
    """Lines above the table that are neither names nor units of its columns."""

    @property
    def notes(self) -> Sequence[str]:
        """Sentences on how the file was read so far."""
        return ()

    @abstractmethod
    def read(self, places: Sequence[int]) -> list[Any]:
        """Return columns as arrays of shape (rows,), or of a constant (1,).

        Cells without a number are NaN. Raises OSError and ValueError.
        """

    @abstractmethod
    def line(self, row: int) -> str:
        """Return where a row is in the file, for a message."""

    @property
    def wanted(self) -> tuple[int, str, float] | None:
        """Column, and its value as a text and a number, of the rows that are read; None: all."""
        if self.form.where is None:
            return None
        name, _, value = (part.strip(" '\"") for part in self.form.where.rpartition("="))
        if name not in self.columns:
            raise InvalidInputError(
                f"where = {shown(self.form.where)} is invalid: must be COLUMN=VALUE, with one of "
                f"{listed(self.columns)}"
            )
        with suppress(ValueError):
            return self.columns[name], value, float(value)
        return self.columns[name], value, nan

    def nothing_where(self, place: int, values: Iterable[str]) -> InvalidInputError:
        """Return the error of a table none of whose rows is wanted, with some it has."""
        has = listed(dict.fromkeys(values, 0))
        return InvalidInputError(
            f"{self.path}: no row has {self.form.where}; {self.name(place)} has {has}"
        )

    def has(self, text: str) -> bool:
        """Return whether the table has all columns of an expression."""
        try:
            Expression.read(self.path, text, self.columns)
        except InvalidInputError:
            return False
        return True

    def name(self, place: int) -> str:
        """Return the name of a column for a message."""
        known = (name for name, column in self.columns.items() if column == place)
        return f"column {next(filterfalse(_NUMBERED.match, known), self.number(place))}"

    def number(self, place: int) -> str:
        """Return the number of a column, as expressions have it."""
        known = (name for name, column in self.columns.items() if column == place)
        number = next(filter(_NUMBERED.match, known), f"#{place + 1}")
        return number if number[0] == "#" else f"'{number}'"

    @property
    def is_own(self) -> bool:
        """Whether the table has the columns that `stickslip simulate --out` always writes."""
        return self.columns.keys() >= {*_OWN_COLUMNS} - {"force", "reference"}

    @property
    def own_columns(self) -> dict[str, str]:
        """Columns by quantity of a table that `stickslip simulate --out` has written.

        Raises InvalidInputError for another one.
        """
        columns = {
            quantity: next((name for name in names if name in self.columns), "")
            for quantity, names in _OWN_COLUMNS.items()
        }
        if not columns["time"] or not columns["position"]:
            raise InvalidInputError(
                f"{self.path} has the columns {listed(self.columns)}, and not those of "
                "`stickslip simulate --out`: say what they are, as in --columns "
                "time=t,position=x,force=u*2.5"
            )
        return {quantity: name for quantity, name in columns.items() if name}


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
