"""Tables as text: CSV files and their relatives, read by pandas once their form is found."""

import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.record.table_columns import Table, TableFormat
from stickslip_ros.record.text_form import GROUPED, TAIL, TIME, form_of, opened
from stickslip_ros.record.units import NO_UNITS, are_units

_MOST_NUMBERS, _CHUNK = 1 << 28, 1 << 18
"""Numbers in the columns that are used, and cells that are read at once."""
_DAY = 86_400.0
_SKIPPED = re.compile(r"Skipping line (\d+)")


class _OtherMarkError(Exception):
    """A decimal mark is not what it was taken for; its text is the mark."""


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
        self.names, self.columns = text.names, text.columns
        self.units = [text.units[place] or self._unit(place) for place in range(text.width)]
        self.decimal, self.period = text.decimal, text.period
        self._refused: Sequence[int] = ()
        self._kept: IntArray | None = None
        self._decimal_commas = False

    @property
    @override
    def turns(self) -> tuple[str, Sequence[str]] | None:
        return next(filter(None, map(self._turn, range(self._text.width))), None)

    def _unit(self, place: int) -> str:
        """Return the unit behind a column in all rows, in a column named `unit` or not at all."""
        behind = self.names[place + 1 : place + 2]
        cells = [*{row[place + 1] for row in self._text.first_rows if behind}]
        known = len(cells) == 1 and (
            are_units(cells) if not behind[0] else behind[0].lower() in NO_UNITS[3:]
        )
        return cells[0] if known else ""

    def _turn(self, place: int) -> tuple[str, list[str]] | None:
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
        if refused := self._refused:
            notes.append(
                f"{len(refused)} lines have more cells than the others and are left out, the "
                f"first is line {refused[0]}"
            )
        return notes

    @override
    def line(self, row: int) -> str:
        number = self._text.first + 1 + (row if self._kept is None else int(self._kept[row]))
        for refused in self._refused:
            number += refused <= number
        return f"line {number}"

    @override
    def read(self, places: Sequence[int]) -> list[Any]:
        """Return columns as arrays of shape (rows,); times become seconds from the first one."""
        try:
            return self._read(places)
        except _OtherMarkError as error:  # what was read so far had another meaning
            self.form = replace(self.form, decimal=str(error))
            return self._read(places)

    def _read(self, places: Sequence[int]) -> list[Any]:
        parts: dict[int, list[Any]] = {place: [] for place in places}
        wanted, kept, rows = self.wanted, list[IntArray](), 0
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for frame in self._frames():
                rows += len(frame)
                if rows * len(places) > _MOST_NUMBERS:
                    raise ValueError(f"it has more than {_MOST_NUMBERS} numbers")
                if frame[places[0]].hasnans:
                    frame = frame[~frame.isna().all(axis=1)]
                if wanted is not None:
                    frame = _rows_of(frame, *wanted)
                kept.append(frame.index.to_numpy())
                for place in places:
                    parts[place].append(self._values(frame[place]))
        texts = (str(warning.message) for warning in caught)
        skipped = [number for text in texts for number in _SKIPPED.findall(text)]
        self._refused = [self._text.first + int(number) for number in skipped]
        self._kept = np.concatenate(kept)
        if wanted is not None and not len(self._kept):
            texts = (row[wanted[0]] for row in self._text.first_rows)
            raise self.nothing_where(wanted[0], texts)
        if len(self._kept) == rows:
            self._kept = None
        self.clocks = {place for place in places if parts[place][0].dtype.kind in "mM"}
        return [self._joined(parts.pop(place)) for place in places]

    def _frames(self) -> Iterator[Any]:
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
                decimal=self.form.decimal or text.decimal,
                skipinitialspace=text.has_blanks,
                skip_blank_lines=False,
                on_bad_lines="warn",
                low_memory=False,
                chunksize=max(1, _CHUNK // text.width),
                **exact,
            )
            yield from frames

    def _joined(self, parts: Sequence[Any]) -> Any:
        """Return the parts of a column as one; instants in s from the first, over midnights."""
        try:
            values = np.concatenate(parts)
        except TypeError:
            raise ValueError("a column has both numbers and times") from None
        if values.dtype.kind not in "mM":
            if self.form.decimal is None and values.dtype.kind == "f":
                _check_points(values, ",." if self.decimal == "," else ".,")
            return values
        known = ~np.isnat(values)
        since, instants = np.full(len(values), np.nan), values[known].astype(np.int64)
        if len(instants):
            kind, first = values.dtype.kind, int(instants[0])
            self.start = self.start or (kind, first)
            since[known] = (instants - (self.start[1] if self.start[0] == kind else first)) / 1e9
        if values.dtype.kind == "m":
            since[known] = np.unwrap(since[known], period=_DAY)
        return since

    def _values(self, cells: Any) -> Any:
        """Return numbers, or instants, of a column as pandas has read it."""
        import pandas as pd

        if cells.dtype.kind in "iuf":
            self._decimal_commas |= cells.dtype.kind == "f" and self.decimal == ","
            return np.array(cells)
        if cells.dtype.kind == "b":
            return np.full(len(cells), np.nan)
        text = cells.astype(str).str.strip(" \t'\"").str.replace(GROUPED, "", regex=True)
        instant = next(filter(None, map(TIME.fullmatch, text.dropna()[:TAIL])), None)
        if instant is not None:
            return _instants(text, instant)
        if self.form.decimal is None:
            grouped = ((".", r",\d*\."), (",", r"\.\d*,"))  # commas, or points, group digits
            marks = (mark for mark, pattern in grouped if text.str.contains(pattern).any())
            points = self.decimal == "," and text.str.contains(".", regex=False).any()
            if mark := next(marks, "," * bool(points)):
                raise _OtherMarkError(mark)
        if self.form.decimal is not None:
            text = text.str.replace("," if self.form.decimal == "." else ".", "", regex=False)
        if self.form.decimal != "." and text.str.contains(",", regex=False).any():
            self._decimal_commas = True
            text = text.str.replace(",", ".", regex=False)
        numbers: Any = pd.to_numeric(text, errors="coerce")
        return numbers.to_numpy(float, na_value=np.nan)


def _check_points(values: FloatArray, marks: str) -> None:
    """Refuse numbers of which some have a mark between thousands: 1.002 comes after 998."""
    before, after = values[:-1], values[1:]
    crossing = (before >= 500.0) & (after >= 1.0) & (after < 2.0)
    if not crossing.any() or np.nanmax(values) >= 1000.0:
        return
    parts = values[(values != np.rint(values)) & np.isfinite(values)]
    row = int(np.flatnonzero(crossing)[0])
    near = abs(1000.0 * after[row] - before[row]) < before[row]
    grouped = (np.abs(parts) >= 1.0) & (np.abs(1e3 * parts - np.rint(1e3 * parts)) < 1e-6)
    if len(parts) and grouped.all() and near and before[row] == np.rint(before[row]):
        raise ValueError(
            f"{after[row]:.3f} comes after {before[row]:g}, as {1e3 * after[row]:g} would: "
            f"--decimal {marks[1]} takes it as this, and --decimal {marks[0]} as it is"
        )


def _rows_of(frame: Any, place: int, value: str, number: float) -> Any:
    """Return the rows of a frame with a value, as a text or a number, in a column."""
    import pandas as pd

    text = frame[place].astype(str).str.strip(" \t'\"")
    same = pd.to_numeric(text, errors="coerce") == number
    return frame[(text == value) | same]


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
