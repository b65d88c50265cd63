"""Tables as text: CSV files and their relatives, read by pandas once their form is found."""

import codecs
import csv
import os
import re
import warnings
from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property
from io import StringIO, TextIOWrapper
from itertools import islice
from math import nan
from pathlib import Path
from statistics import mode
from typing import Any

import numpy as np

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import open_regular
from stickslip_ros.record.expressions import listed
from stickslip_ros.record.table_columns import Table, TableFormat
from stickslip_ros.record.units import are_units, joined_units, period_in, without_unit
from stickslip_ros.text import shown

_HEAD, _TAIL, _TOP = 1 << 20, 10, 100
"""Bytes from which the form is found; lines at their end that are rows, with or without more; lines
above the rows that may tell their period, and first rows that are looked at."""
_LARGEST, _MOST_NUMBERS, _MOST_COLUMNS, _CHUNK = 1 << 33, 1 << 28, 10_000, 1 << 18
"""Bytes of a file, numbers in the columns that are used, columns, and cells that are read at once.
"""
_DAY = 86_400.0

_SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "|", " ": "spaces", ",": "commas"}
_NUMBER = re.compile(
    r"[-+]?(?:\d+(?:[.,]\d+)*\.?|[.,]\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)", re.IGNORECASE
)
_CLOCK = r"\d{1,2}:\d\d(?::\d\d(?:[.,:]\d+)?)?"
_TIME = re.compile(
    rf"(?P<date>\d{{1,4}}([-./])\d{{1,2}}\2\d{{1,4}})(?:,?[T ] ?{_CLOCK})?"
    rf"(?: ?[AP]M)?(?: ?Z|[+-]\d\d(?::?\d\d)?)?|{_CLOCK}(?: ?[AP]M)?",
    re.IGNORECASE,
)
_COMMENT = re.compile(r"^\s*(?:#|%|//)\s*")


class TextTable(Table):
    """A table as text, of which the form is known; its columns are read when they are needed."""

    def __init__(self, path: Path, given: TableFormat) -> None:
        """Find the form of a table; raises OSError and ValueError if the file has none."""
        self.path, self.form, self._decimal = path, given, given.decimal
        with open_regular(path) as stream:
            if os.fstat(stream.fileno()).st_size > _LARGEST:
                raise ValueError(f"it has more than {_LARGEST} bytes")
            head = stream.read(_HEAD)
        self._encoding = given.encoding or _encoding_of(head)
        text = head.decode(self._encoding, errors="replace")
        if len(re.findall(r"[\x00-\x08\x0e-\x1f]", text)) > len(text) // 100:
            raise ValueError("it is no text; say its encoding if it is, such as utf-16")
        lines = [*StringIO(text, newline=None)]
        if len(head) == _HEAD and len(lines) > 1:
            del lines[-1]  # a part of a line
        self._seen_decimal = "."
        self._kept: IntArray | None = None
        self._omitted: list[int] = []
        self._refused: list[int] = []
        self._find(lines, given.skip or 0)

    def _find(self, lines: list[str], skip: int) -> None:
        """Find the separator, the names, their units and the first row."""
        tail = [*islice(filter(str.strip, reversed(lines[skip:])), _TAIL)][::-1]
        if not tail:
            raise ValueError("it is empty")
        self._separator = max(_SEPARATORS, key=lambda each: _likelihood(each, tail, lines[skip:]))
        blank = re.compile(f"(^|{re.escape(self._separator)}) ", re.MULTILINE)
        self._has_blanks = blank.search("".join(lines)) is not None
        rows = [_cells(line, self._separator) for line in tail]
        self.width = width = mode(map(len, rows))
        rows = [row for row in rows if len(row) == width]
        marks = {
            mark for row in rows for cell in row if _is_value(cell) for mark in ".," if mark in cell
        }
        self.decimal = self._decimal or ("," if marks == {","} else ".")
        numeric = [
            _is_value(each[-1]) or sum(map(_is_value, each)) > sum(map(_is_text, each))
            for each in zip(*rows, strict=True)
        ]
        self.period = next(filter(None, map(period_in, lines[:_TOP])), None)
        fewest = 2 if self.form.period is None and self.period is None else 1
        if width < fewest or sum(numeric) < fewest:
            raise ValueError(
                "it has no rows of two numbers or more, whatever the separator; options say its "
                "--decimal mark, the lines to --skip and its --encoding"
            )
        if width > _MOST_COLUMNS:
            raise ValueError(f"it has more than {_MOST_COLUMNS} columns")

        def texts_and_values(row: list[str]) -> tuple[int, int]:
            own = [cell for cell, is_number in zip(row, numeric, strict=False) if is_number]
            return sum(map(_is_text, own)), sum(map(_is_value, own))

        start = skip
        while start < len(lines):
            row = _cells(lines[start], self._separator)
            texts, values = texts_and_values(row)
            if len(row) == width and values and not texts:
                break
            start += 1
        names: list[tuple[int, list[str]]] = []  # lines of texts above, from the lowest
        for place in range(start - 1, -1, -1):
            row = _cells(_COMMENT.sub("", lines[place]), self._separator)
            if not lines[place].strip() and not names and place >= skip:
                continue
            texts, values = texts_and_values(row)
            row = joined_units(row, width)
            if len(row) == width - 1 and not any(row[-1] for row in rows):
                row.append("")  # a separator at the end of each row
            wrong = 1 < len(row) != width and self._separator != " " and place >= skip
            if not names and not values and wrong:
                raise ValueError(
                    f"line {place + 1} has {len(row)} names for {width} columns; with --skip "
                    f"{place + 1} they are #1 to #{width}"
                )
            if len(row) != width or (values and names) or (not values and not any(row)):
                break
            if not values:
                names.append((place, row))
        self._skipped, self._units_line, units = names[0][0] if names else start, None, [""] * width
        start = max(skip, names[0][0] + 1) if names else start
        if len(names) > 1:
            lower, upper = (are_units(row) for _, row in names[:2])
            if lower or upper:
                self._skipped = names[1][0]
                place, units = names.pop(0 if lower else 1)
                self._units_line = place + 1
        self.first, self.named = start, names[0][0] + 1 if names else None
        self.names = tuple(names[0][1]) if names else ("",) * width
        self.units = tuple(units)
        labels = {
            place: rows[0][place]
            for place in range(0 if names else width - 1)
            if not numeric[place] and numeric[place + 1] and len({row[place] for row in rows}) == 1
        }
        values = [place for place in range(width) if place not in labels]
        self.names = tuple(labels.get(place - 1, name) for place, name in enumerate(self.names))
        self._labelled = len(labels) > 0
        self.columns = {f"#{number}": place for number, place in enumerate(values, start=1)}
        for names_of_columns in (self.names, map(without_unit, self.names)):
            for place, name in enumerate(names_of_columns):
                if name:
                    self.columns.setdefault(name, place)
        self._top_lines = lines[start : start + _TOP]

    @cached_property
    def _top(self) -> list[list[str]]:
        """The cells of the first rows."""
        rows = [_cells(line, self._separator) for line in self._top_lines]
        return [row for row in rows if len(row) == self.width]

    @property
    def turns(self) -> tuple[str, Sequence[str]] | None:
        """A column whose values take turns in the first rows."""
        return next(filter(None, map(self._turn, range(self.width))), None)

    def _turn(self, place: int) -> tuple[str, list[str]] | None:
        """Return the values of a column that take turns, and its name."""
        cells = [row[place] for row in self._top]
        turn = [*dict.fromkeys(cells)]
        in_turn = all(cell == turn[row % len(turn)] for row, cell in enumerate(cells))
        if not (in_turn and 1 < len(turn) <= len(cells) // 2):
            return None
        return self.name(place).removeprefix("column "), turn

    @property
    def notes(self) -> list[str]:
        """Sentences on what was taken for what, if it is not the usual, and on what was omitted."""
        taken = [
            *([] if self._separator == "," else [f"{_SEPARATORS[self._separator]} as separators"]),
            *([] if self._seen_decimal == "." else ["decimal commas"]),
            *([] if self._encoding.startswith("utf-8") else [f"text in {self._encoding}"]),
            *([f"the first {self._skipped} lines skipped"] if self._skipped > 1 else []),
            *(["the first line skipped"] if self._skipped == 1 else []),
            *([f"the names in each row: {listed(self.columns)}"] if self._labelled else []),
            *([] if any(self.names) else [f"no names: the columns are #1 to #{self.width}"]),
            *([f"units in line {self._units_line}"] if self._units_line else []),
        ]
        notes = [f"the table is read with {', '.join(taken)}"] if taken else []
        if self._refused:
            notes.append(
                f"{len(self._refused)} lines have more cells than the others and are left out, the "
                f"first is line {self._refused[0]}"
            )
        return notes

    def line(self, row: int) -> str:
        """Return where a row is, for a message."""
        if self._kept is not None:
            return f"line {self.first + 1 + self._kept[row]}"
        line = self.first + 1 + row
        for each in self._omitted:
            line += each <= line
        return f"line {line}"

    def read(self, places: Sequence[int]) -> list[Any]:
        """Return columns as arrays of shape (rows,); times become seconds from the first one."""
        import pandas as pd

        version = tuple(map(int, pd.__version__.split(".")[:2]))
        # From 3.1 on this is the default, and naming it is deprecated.
        exact: Any = {} if version >= (3, 1) else {"float_precision": "round_trip"}
        parts: dict[int, list[Any]] = {place: [] for place in places}
        which, value, number = self._where()
        kept: list[Any] = []
        blank: list[int] = []
        with (
            open_regular(self.path) as stream,
            TextIOWrapper(stream, encoding=self._encoding, errors="replace", newline="") as file,
            warnings.catch_warnings(record=True) as caught,
        ):
            warnings.simplefilter("always")
            for _ in range(self.first):
                file.readline()
            frames: Any = pd.read_csv(
                file,
                header=None,
                names=range(self.width),
                index_col=False,
                sep=r"\s+" if self._separator == " " else self._separator,
                decimal=self.decimal,
                skipinitialspace=self._has_blanks,
                skip_blank_lines=False,
                on_bad_lines="warn",
                low_memory=False,
                chunksize=max(1, _CHUNK // self.width),
                **exact,
            )
            rows = 0
            for frame in frames:
                rows += len(frame)
                if rows * len(places) > _MOST_NUMBERS:
                    raise ValueError(f"it has more than {_MOST_NUMBERS} numbers")
                if frame[places[0]].hasnans:
                    empty = frame.isna().all(axis=1)
                    blank += [self.first + 1 + row for row in frame.index[empty]]
                    frame = frame[~empty]
                if which is not None:
                    text = frame[which].astype(str).str.strip(" \t'\"")
                    same = pd.to_numeric(text, errors="coerce") == number
                    frame = frame[(text == value) | same]
                    kept.append(frame.index.to_numpy())
                for place in places:
                    parts[place].append(self._values(frame[place]))
        if which is not None:
            self._kept = np.concatenate(kept)
            if not len(self._kept):
                values = dict.fromkeys(row[which] for row in self._top)
                raise InvalidInputError(
                    f"{self.path}: no row has {self.form.where}; {self.name(which)} has "
                    f"{listed(dict.fromkeys(values, 0))}"
                )
        lines = [number for each in caught for number in _SKIPPED.findall(str(each.message))]
        self._refused = [self.first + int(number) for number in lines]
        self._omitted = sorted([*blank, *self._refused])
        self.clocks = {place for place, each in parts.items() if each[0].dtype.kind in "mM"}
        return [_joined(parts.pop(place)) for place in places]

    def _where(self) -> tuple[int | None, str, float]:
        """Return the column and the value, also as a number, of the rows that are read."""
        if self.form.where is None:
            return None, "", nan
        name, _, value = (each.strip(" '\"") for each in self.form.where.rpartition("="))
        if name not in self.columns:
            raise InvalidInputError(
                f"where = {shown(self.form.where)} is invalid: must be COLUMN=VALUE, with one of "
                f"{listed(self.columns)}"
            )
        with suppress(ValueError):
            return self.columns[name], value, float(value)
        return self.columns[name], value, nan

    def _values(self, cells: Any) -> Any:
        """Return numbers, or instants, of a column as pandas has read it."""
        import pandas as pd

        if cells.dtype.kind in "iuf":
            if cells.dtype.kind == "f" and self.decimal == ",":
                self._seen_decimal = ","
            return np.array(cells)
        if cells.dtype.kind == "b":
            return np.full(len(cells), np.nan)
        text = cells.astype(str).str.strip(" \t'\"")
        found = next(filter(None, map(_TIME.fullmatch, text.dropna()[:_TAIL])), None)
        if found is not None:
            return _instants(text, found)
        if self._decimal:
            text = text.str.replace("," if self._decimal == "." else ".", "", regex=False)
        elif text.str.contains(r",\d*\.").any():  # the commas group digits
            text = text.str.replace(",", "", regex=False)
        elif text.str.contains(r"\.\d*,").any():
            text = text.str.replace(".", "", regex=False)
        if (self._decimal or ",") == "," and text.str.contains(",", regex=False).any():
            self._seen_decimal = ","
            text = text.str.replace(",", ".", regex=False)
        numbers: Any = pd.to_numeric(text, errors="coerce")
        return numbers.to_numpy(float, na_value=np.nan)


_SKIPPED = re.compile(r"Skipping line (\d+)")


def _instants(text: Any, found: re.Match[str]) -> Any:
    """Return times of day, or dates with them, like `found`."""
    import pandas as pd

    text = text.str.replace(r",(?=\d)", ".", regex=True)
    text = text.str.replace(r"(:\d\d:\d\d):(?=\d)", r"\1.", regex=True)
    if found["date"] is None and found[0][-1] not in "mM":
        return pd.to_timedelta(text, errors="coerce").to_numpy("timedelta64[ns]")
    instants: Any = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
    if instants.isna().all():
        day_first = "." in (found["date"] or "")
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


def _encoding_of(head: bytes) -> str:
    """Return the encoding of a text by its mark, its zeros, or whether it is UTF-8."""
    if head.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for encoding, high in (("utf-16-le", head[1::2]), ("utf-16-be", head[::2])):
        if 2 * high.count(0) > len(high):
            return encoding
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _likelihood(separator: str, tail: Sequence[str], lines: Sequence[str]) -> float:
    """Return the share of numbers among the cells, and a little more for a line of names."""
    rows = [_cells(line, separator) for line in tail]
    width = mode(map(len, rows))
    if width < 2:
        return 0.0
    cells = [cell for row in rows for cell in row]
    values = sum(_is_value(cell) for row in rows if len(row) == width for cell in row)
    named = any(
        len(row) == width and all(map(_is_text, row))
        for row in (_cells(_COMMENT.sub("", line), separator) for line in lines[:100])
    )
    empty = sum(not cell for cell in cells)
    return values / max(1, len(cells) - empty) + 0.1 * named


def _cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without the blanks around them."""
    if separator == " ":
        line = " ".join(line.split())
    try:
        found = next(
            csv.reader([line.strip("\r\n")], delimiter=separator, skipinitialspace=True), []
        )
    except csv.Error:
        return [line]
    return [cell.strip() for cell in found]


def _is_value(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None or _TIME.fullmatch(cell) is not None


def _is_text(cell: str) -> bool:
    return any(map(str.isalpha, cell)) and not _is_value(cell) and cell.lower() not in _NO_NUMBERS


_NO_NUMBERS = ("", "na", "n/a", "null", "none", "#n/a", "#na", "<na>")
