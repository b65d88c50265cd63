"""Tables as text: CSV files and their relatives, read by pandas once their form is found."""

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import TextIOWrapper
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.record.expressions import listed
from stickslip_ros.record.table_columns import Table, TableFormat
from stickslip_ros.record.text_form import TAIL, TIME, form_of, opened
from stickslip_ros.text import shown

_MOST_NUMBERS, _CHUNK = 1 << 28, 1 << 18
"""Numbers in the columns that are used, and cells that are read at once."""
_DAY = 86_400.0
_SKIPPED = re.compile(r"Skipping line (\d+)")


@dataclass(frozen=True)
class _Lines:
    """The lines of the rows that were read."""

    first: int
    """Number of the first one, from 1."""
    omitted: Sequence[int] = ()
    """Numbers of lines that are blank or refused, in order."""
    refused: Sequence[int] = ()
    """Numbers of lines with more cells than the others."""
    kept: IntArray | None = None
    """Places of the rows that were asked for; None: of all."""

    def number(self, row: int) -> int:
        """Return the number of the line of a row."""
        if self.kept is not None:
            return self.first + int(self.kept[row])
        line = self.first + row
        for omitted in self.omitted:
            line += omitted <= line
        return line


class _Wanted(NamedTuple):
    """The rows that are read: those with a value in a column, as a text or a number."""

    place: int
    text: str
    number: float

    def rows_of(self, frame: Any) -> Any:
        """Return those of a frame."""
        import pandas as pd

        text = frame[self.place].astype(str).str.strip(" \t'\"")
        same = pd.to_numeric(text, errors="coerce") == self.number
        return frame[(text == self.text) | same]


class TextTable(Table):
    """A table as text, of which the form is known; its columns are read when they are needed."""

    def __init__(
        self,
        path: Path,
        given: TableFormat,
        content: bytes | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        """Find the form of a table; raises OSError and ValueError if the file has none.

        `content` is what a file of another format was converted to, with `notes` on how.
        """
        self.path, self.form, self._content, self._converted = path, given, content, notes
        with opened(path, content) as stream:
            self._text = text = form_of(stream, given)
        self.names, self.units, self.columns = text.names, text.units, text.columns
        self.decimal, self.period = text.decimal, text.period
        self._lines = _Lines(text.first + 1)
        self._decimal_commas = False

    @property
    @override
    def turns(self) -> tuple[str, Sequence[str]] | None:
        return next(filter(None, map(self._turn, range(self._text.width))), None)

    def _turn(self, place: int) -> tuple[str, list[str]] | None:
        """Return the values of a column that take turns, and its name."""
        cells = [row[place] for row in self._text.first_rows]
        turn = [*dict.fromkeys(cells)]
        in_turn = all(cell == turn[row % len(turn)] for row, cell in enumerate(cells))
        if not (in_turn and 1 < len(turn) <= len(cells) // 2):
            return None
        return self.name(place).removeprefix("column "), turn

    @property
    @override
    def notes(self) -> list[str]:
        features = self._text.features(decimal_commas=self._decimal_commas)
        notes = [*self._converted]
        if features:
            notes.append(f"the table is read with {', '.join(features)}")
        if refused := self._lines.refused:
            notes.append(
                f"{len(refused)} lines have more cells than the others and are left out, the "
                f"first is line {refused[0]}"
            )
        return notes

    @override
    def line(self, row: int) -> str:
        return f"line {self._lines.number(row)}"

    @override
    def read(self, places: Sequence[int]) -> list[Any]:
        """Return columns as arrays of shape (rows,); times become seconds from the first one."""
        parts: dict[int, list[Any]] = {place: [] for place in places}
        wanted, first = self._wanted(), self._lines.first
        kept: list[Any] = []
        blank: list[int] = []
        rows = 0
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for frame in self._frames():
                rows += len(frame)
                if rows * len(places) > _MOST_NUMBERS:
                    raise ValueError(f"it has more than {_MOST_NUMBERS} numbers")
                if frame[places[0]].hasnans:
                    empty = frame.isna().all(axis=1)
                    blank += [first + row for row in frame.index[empty]]
                    frame = frame[~empty]
                if wanted is not None:
                    frame = wanted.rows_of(frame)
                    kept.append(frame.index.to_numpy())
                for place in places:
                    parts[place].append(self._values(frame[place]))
        skipped = [
            number for warning in caught for number in _SKIPPED.findall(str(warning.message))
        ]
        refused = [first - 1 + int(number) for number in skipped]
        if wanted is not None and not any(map(len, kept)):
            raise self._nothing_where(wanted.place)
        places_kept = np.concatenate(kept) if kept else None
        self._lines = _Lines(first, sorted([*blank, *refused]), refused, places_kept)
        self.clocks = {place for place in places if parts[place][0].dtype.kind in "mM"}
        return [_joined(parts.pop(place)) for place in places]

    def _frames(self) -> Iterator[Any]:
        """Yield the rows, in parts, as frames of pandas."""
        import pandas as pd

        text = self._text
        version = tuple(map(int, pd.__version__.split(".")[:2]))
        # From 3.1 on this is the default, and naming it is deprecated.
        exact: Any = {} if version >= (3, 1) else {"float_precision": "round_trip"}
        with (
            opened(self.path, self._content) as stream,
            TextIOWrapper(stream, encoding=text.encoding, errors="replace", newline="") as file,
        ):
            for _ in range(text.first):
                file.readline()
            frames: Any = pd.read_csv(
                file,
                header=None,
                names=range(text.width),
                index_col=False,
                sep=r"\s+" if text.separator == " " else text.separator,
                decimal=text.decimal,
                skipinitialspace=text.has_blanks,
                skip_blank_lines=False,
                on_bad_lines="warn",
                low_memory=False,
                chunksize=max(1, _CHUNK // text.width),
                **exact,
            )
            yield from frames

    def _wanted(self) -> _Wanted | None:
        """Return which rows are read; None: all."""
        if self.form.where is None:
            return None
        name, _, value = (part.strip(" '\"") for part in self.form.where.rpartition("="))
        if name not in self.columns:
            raise InvalidInputError(
                f"where = {shown(self.form.where)} is invalid: must be COLUMN=VALUE, with one of "
                f"{listed(self.columns)}"
            )
        with suppress(ValueError):
            return _Wanted(self.columns[name], value, float(value))
        return _Wanted(self.columns[name], value, nan)

    def _nothing_where(self, place: int) -> InvalidInputError:
        values = dict.fromkeys((row[place] for row in self._text.first_rows), 0)
        return InvalidInputError(
            f"{self.path}: no row has {self.form.where}; {self.name(place)} has {listed(values)}"
        )

    def _values(self, cells: Any) -> Any:
        """Return numbers, or instants, of a column as pandas has read it."""
        import pandas as pd

        if cells.dtype.kind in "iuf":
            self._decimal_commas |= cells.dtype.kind == "f" and self.decimal == ","
            return np.array(cells)
        if cells.dtype.kind == "b":
            return np.full(len(cells), np.nan)
        text = cells.astype(str).str.strip(" \t'\"")
        instant = next(filter(None, map(TIME.fullmatch, text.dropna()[:TAIL])), None)
        if instant is not None:
            return _instants(text, instant)
        given = self.form.decimal
        if given:
            text = text.str.replace("," if given == "." else ".", "", regex=False)
        elif text.str.contains(r",\d*\.").any():  # the commas group digits
            text = text.str.replace(",", "", regex=False)
        elif text.str.contains(r"\.\d*,").any():
            text = text.str.replace(".", "", regex=False)
        if (given or ",") == "," and text.str.contains(",", regex=False).any():
            self._decimal_commas = True
            text = text.str.replace(",", ".", regex=False)
        numbers: Any = pd.to_numeric(text, errors="coerce")
        return numbers.to_numpy(float, na_value=np.nan)


def _instants(text: Any, like: re.Match[str]) -> Any:
    """Return times of day, or dates with them, like one of them."""
    import pandas as pd

    text = text.str.replace(r",(?=\d)", ".", regex=True)
    text = text.str.replace(r"(:\d\d:\d\d):(?=\d)", r"\1.", regex=True)
    if like["date"] is None and like[0][-1] not in "mM":
        return pd.to_timedelta(text, errors="coerce").to_numpy("timedelta64[ns]")
    instants: Any = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
    if instants.isna().all():
        day_first = "." in (like["date"] or "")
        instants = pd.to_datetime(text, dayfirst=day_first, utc=True, errors="coerce")
    return instants.dt.tz_localize(None).to_numpy("datetime64[ns]")


def _joined(parts: Sequence[Any]) -> Any:
    """Return the parts of a column as one; instants in s from the first, over midnights."""
    try:
        values = np.concatenate(parts)
    except TypeError:
        raise ValueError("a column has both numbers and times") from None
    if values.dtype.kind not in "mM":
        return values
    known = ~np.isnat(values)
    since = np.full(len(values), np.nan)
    if known.any():
        since[known] = (values[known] - values[known][0]).astype(np.int64) / 1e9
    if values.dtype.kind == "m":
        since[known] = np.unwrap(since[known], period=_DAY)
    return since
