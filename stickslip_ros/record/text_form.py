"""The form of a table as text: separator, decimal mark, lines on top, names, units, first row.

The last rows tell the separator and the columns of numbers, and with these which line is the first
row; the lines of texts above that one are names and units.
"""

import codecs
import csv
import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from io import BytesIO
from itertools import islice
from pathlib import Path
from statistics import mode
from typing import BinaryIO
from unicodedata import normalize

from stickslip_ros.files import open_regular
from stickslip_ros.record.expressions import listed
from stickslip_ros.record.header_units import (
    NO_UNITS,
    are_units,
    joined_units,
    period_in,
    without_unit,
)
from stickslip_ros.record.table_columns import TableFormat
from stickslip_ros.record.text_cells import NUMBER, TIME, unit_of

_HEAD = 1 << 20
"""Bytes from which the form is found."""
_TAIL = 10
"""Lines at their end that are rows of the table: by them the others are known."""
_TOP = 100
"""Lines on top that may be names or tell the period; first rows that are kept."""
_LARGEST, _MOST_COLUMNS, _LONGEST = 1 << 33, 10_000, 500
"""Bytes of a file, columns, and characters of a line above them in which units are looked for."""

_SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "|", " ": "spaces", ",": "commas"}
_Line = tuple[int, list[str]]
"""Place of a line, and its cells."""
_CYRILLIC = re.compile(
    rb"[\xe0-\xff](?:[\xe0-\xff]{2}|[\xc0-\xde\xec])|\xec\xf1|[\xc0-\xdf]{3}|\xcc[\xcc\xd1]|\xca\xcd"
)
"""Letters in cp1251 that cp1252 would show as a row of accents, such as those of mm, ms and kN."""
_JAPANESE = re.compile(rb"(?=[\x81-\x9f])(?:[\x81-\x9f\xe0-\xea][\x40-\x7e\x80-\xfc]){2}")
"""Two letters in Shift-JIS."""
_BROKEN = re.compile(r'(?<![^\n,;\t|])"[^"\n]*(?:\n[^"\n]*){1,3}"(?![^\n,;\t|])')
"""A cell in quotes of several lines, as a name with its unit below."""
_JOINED = "\v\n"
"""In place of a line that is at the start of the next one."""
_COMMENT = re.compile(r"^\s*(?:#|%|//)\s*")
_UNIT_OF = re.compile(r"(?i)\w\W?units?\W*$")
"""What is before the unit of a channel: `HUnit`, `Length unit:`."""
_NO_NUMBERS = ("", "na", "n/a", "null", "none", "#n/a", "#na", "<na>")


@dataclass(frozen=True)
class Head:
    """What the lines above the rows of a table say."""

    names: Sequence[str]
    """Name of each column; empty if it has none."""
    units: Sequence[str]
    """Cells of the columns in a line of units; empty without one."""
    units_line: int | None
    """Number of this line, from 1."""
    skipped: int
    """Number of lines before the names or, without names, the rows."""
    first: int
    """Number of lines before the first row."""


@dataclass(frozen=True)
class TextForm(Head):
    """The form of a table as text."""

    encoding: str
    separator: str
    decimal: str
    """Decimal mark."""
    columns: Mapping[str, int]
    """Places of the columns by name and by number, without those of labels."""
    labelled: bool
    """Whether each row has names before its values."""
    period: tuple[float, float] | None
    """Period of the rows that a line above them tells, s and in its own unit."""
    first_lines: Sequence[str]
    """The first rows."""
    remarks: Sequence[str]
    """Lines above the rows that are neither names nor units, nor tell the period."""

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.names)

    @cached_property
    def first_rows(self) -> list[list[str]]:
        """The cells of the first rows."""
        rows = [_cells(line, self.separator) for line in self.first_lines]
        return [row for row in rows if len(row) == self.width]

    @property
    def turns(self) -> tuple[int, list[str]] | None:
        """The first column whose values take turns in the first rows, and these values."""
        for place, cells in enumerate(zip(*self.first_rows, strict=True)):
            turn = [*dict.fromkeys(cells)]
            in_turn = all(cell == turn[row % len(turn)] for row, cell in enumerate(cells))
            if in_turn and 1 < len(turn) <= len(cells) // 2:
                return place, turn
        return None

    def unit_behind(self, place: int) -> str:
        """Return the unit behind a column in all rows, in a column named `unit` or not at all.

        It is in the cells of the column or in those of the next one.
        """
        inside = {unit_of(row[place]) for row in self.first_rows}
        if len(inside) == 1 and (unit := inside.pop()):
            return unit
        behind = self.names[place + 1 : place + 2]
        cells = [*{row[place + 1] for row in self.first_rows if behind}]
        if len(cells) != 1 or place + 1 not in self.columns.values():
            return ""
        is_unit = behind[0].lower() in NO_UNITS[3:] if behind[0] else are_units(cells)
        return cells[0] if is_unit else ""

    def features(self, marks: Iterable[str]) -> list[str]:
        """Return what is not the usual, as phrases, with what marks in the cells were read as."""
        skipped = f"the first {self.skipped} lines" if self.skipped > 1 else "the first line"
        unusual = {
            f"{_SEPARATORS[self.separator]} as separators": self.separator != ",",
            **dict.fromkeys(marks, True),
            f"text in {self.encoding}": not self.encoding.startswith("utf-8"),
            f"{skipped} skipped": self.skipped > 0,
            f"the names in each row: {listed(self.columns)}": self.labelled,
            f"no names: the columns are #1 to #{self.width}": not any(self.names),
            f"units in line {self.units_line}": self.units_line is not None,
        }
        return [phrase for phrase, applies in unusual.items() if applies]


def opened(path: Path, content: bytes | None) -> BinaryIO:
    """Open a text: that of a file or, given its content, what the file was converted to."""
    if content is not None:
        return BytesIO(content)
    stream = open_regular(path)
    if os.fstat(stream.fileno()).st_size > _LARGEST:
        stream.close()
        raise ValueError(f"it has more than {_LARGEST} bytes")
    return stream


def form_of(stream: BinaryIO, given: TableFormat) -> TextForm:
    """Return the form of a table in an open text; raises OSError and ValueError if it has none."""
    lines, encoding = _lines_of(stream.read(_HEAD), given.encoding)
    skip = given.skip or 0
    period = next(filter(None, map(period_in, lines[:_TOP])), None)
    rows = _last_rows(lines[skip:], fewest=2 if given.period is None and period is None else 1)
    places = range(skip, len(lines))
    first = next((place for place in places if rows.is_row(lines[place])), max(skip, len(lines)))
    texts = _texts_above(lines, first, skip, rows)
    head = _head_in(texts, first, skip, rows.width)
    labels = {} if texts else rows.labels
    names = [labels.get(place - 1, name) for place, name in enumerate(head.names)]
    known = {head.skipped, (head.units_line or 0) - 1}
    above = [
        normalize("NFKC", _COMMENT.sub("", line)[:_LONGEST].replace('"', " ").strip())
        for place, line in enumerate(lines[: head.first][:_TOP])
        if place not in known and not period_in(line)
    ]
    joined = lines[: head.skipped].count(_JOINED)
    head = replace(head, names=names, skipped=head.skipped - joined)
    form = TextForm(
        **vars(head),
        encoding=encoding,
        separator=rows.separator,
        decimal=given.decimal or rows.decimal,
        columns=_columns(names, labels),
        labelled=len(labels) > 0,
        period=period,
        first_lines=lines[head.first : head.first + _TOP],
        remarks=above,
    )
    return replace(form, units=[unit or form.unit_behind(n) for n, unit in enumerate(form.units)])


def _lines_of(head: bytes, encoding: str | None) -> tuple[list[str], str]:
    """Return the whole lines at the start of a text, and its encoding."""
    encoding = encoding or _encoding_of(head)
    text = head.decode(encoding, errors="replace")
    if len(re.findall(r"[\x00-\x08\x0e-\x1f]", text)) > len(text) // 100:
        raise ValueError("it is no text; say its encoding if it is, such as utf-16")
    text = _BROKEN.sub(lambda cell: cell[0].replace("\n", "\v"), re.sub("\r\n?", "\n", text))
    lines = list[str]()
    for line in text.split("\n"):
        lines += [_JOINED] * line.count("\v") + [line.replace("\v", " ") + "\n"]
    cut_off = len(head) == _HEAD and len(lines) > 1
    return lines[:-1] if cut_off else lines, encoding


def _encoding_of(head: bytes) -> str:
    """Return the encoding of a text by its mark, its zeros, or whether it is UTF-8."""
    if head.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for encoding, high in (("utf-16-le", head[1::2]), ("utf-16-be", head[::2])):
        if 2 * high.count(0) > len(high):
            return encoding
    fitting = [*filter(partial(_decodes, head), ("utf-8", "shift_jis", "cp932"))]
    if fitting[:1] == ["utf-8"]:
        return "utf-8"
    if fitting and _JAPANESE.search(head):
        raise ValueError(
            f"it may be Japanese text: --encoding {fitting[0]} reads it, and --encoding cp1252 as "
            "text of Western Europe"
        )
    return "cp1251" if _CYRILLIC.search(head) else "cp1252"


def _decodes(head: bytes, encoding: str) -> bool:
    with suppress(UnicodeDecodeError):
        codecs.getincrementaldecoder(encoding)().decode(head)
        return True
    return False


@dataclass(frozen=True)
class _LastRows:
    """Rows at the end of the head of a table: all of one width, and by them others are known."""

    separator: str
    rows: list[list[str]]
    """Cells of the lines, whatever their width."""

    @cached_property
    def width(self) -> int:
        """Number of columns."""
        return mode(map(len, self.rows))

    @cached_property
    def cells(self) -> list[list[str]]:
        """Those of the rows of this width."""
        return [row for row in self.rows if len(row) == self.width]

    def likelihood(self, lines: Sequence[str]) -> float:
        """Return the share of numbers among the cells, and a little more for a line of names."""
        if self.width < 2:
            return 0.0
        values = sum(_is_value(cell) for row in self.cells for cell in row)
        filled = sum(cell != "" for row in self.rows for cell in row)
        above = (_cells(_COMMENT.sub("", line), self.separator) for line in lines[:_TOP])
        named = any(len(row) == self.width and all(map(_is_text, row)) for row in above)
        return values / max(1, filled) + 0.1 * named

    @property
    def decimal(self) -> str:
        """The decimal mark: a comma if values have no other mark."""
        values = (cell for row in self.cells for cell in row if _is_value(cell))
        marks = {mark for cell in values for mark in ".," if mark in cell}
        return "," if marks == {","} else "."

    @cached_property
    def numeric(self) -> list[bool]:
        """Whether each column has numbers."""
        return [
            _is_value(column[-1]) or sum(map(_is_value, column)) > sum(map(_is_text, column))
            for column in zip(*self.cells, strict=True)
        ]

    @property
    def labels(self) -> dict[int, str]:
        """Texts that are the same in all rows, each before a number, by their places."""
        return {
            place: text
            for place, text in enumerate(self.cells[0][:-1])
            if text
            and not self.numeric[place]
            and self.numeric[place + 1]
            and not (self.numeric[0] and are_units([text]))
            and all(row[place] == text for row in self.cells)
        }

    def texts_and_values(self, row: list[str]) -> tuple[int, int]:
        """Return the numbers of texts and of values that a row has in the columns of numbers."""
        cells = [cell for cell, numeric in zip(row, self.numeric, strict=False) if numeric]
        return sum(map(_is_text, cells)), sum(map(_is_value, cells))

    def is_row(self, line: str) -> bool:
        """Return whether a line is a row of the table."""
        row = _cells(line, self.separator)
        texts, values = self.texts_and_values(row)
        return len(row) == self.width and values > 0 and texts == 0


def _last_rows(lines: list[str], fewest: int) -> _LastRows:
    """Return the last rows, by the separator that makes most of them numbers.

    Raises ValueError for fewer columns of numbers than asked for, and for too many columns.
    """
    tail = [*islice(filter(str.strip, reversed(lines)), _TAIL)][::-1]
    if not tail:
        raise ValueError("it is empty")
    candidates = [_LastRows(mark, [_cells(line, mark) for line in tail]) for mark in _SEPARATORS]
    rows = max(candidates, key=lambda rows: rows.likelihood(lines))
    if rows.width < fewest or sum(rows.numeric) < fewest:
        raise ValueError(
            "it has no rows of two numbers or more, whatever the separator: numbers stand alone in "
            "their cells or before a unit, not as t=0.1; options say its --decimal mark, the lines "
            "to --skip and its --encoding"
        )
    if rows.width > _MOST_COLUMNS:
        raise ValueError(f"it has more than {_MOST_COLUMNS} columns")
    return rows


def _head_in(texts: Sequence[_Line], first: int, skip: int, width: int) -> Head:
    """Return names and units: one of two lines of texts may have the units."""
    empty = [""] * width
    if not texts:
        return Head(empty, empty, None, first, first)
    facts = {row[0].casefold(): (place, row) for place, row in texts if _is_fact(row)}
    if names := [fact for key, fact in facts.items() if "name" in key]:
        place, units = next((facts[key] for key in NO_UNITS if key in facts), (None, empty))
        line = None if place is None else place + 1
        return Head(names[-1][1], units, line, names[-1][0], first)
    (place, lower), *above = texts
    first = max(skip, place + 1)
    for upper_place, upper in above[:1]:
        if are_units(lower):
            return Head(upper, lower, place + 1, upper_place, first)
        if [without_unit(name) or name for name in upper] == lower:
            return Head(upper, empty, None, upper_place, first)
        if are_units(upper):
            return Head(lower, upper, upper_place + 1, upper_place, first)
    return Head(lower, empty, None, place, first)


def _texts_above(lines: list[str], first: int, skip: int, rows: _LastRows) -> list[_Line]:
    """Return the lines of texts above the first row, the lowest first."""
    width, texts = rows.width, list[_Line]()
    for place in range(first - 1, -1, -1):
        if not texts and place >= skip and not lines[place].strip():
            continue
        row = _cells(_COMMENT.sub("", lines[place]), rows.separator)
        _, values = rows.texts_and_values(row)
        row = joined_units(row, width)
        if len(row) == 2 and _UNIT_OF.search(row[0]) and are_units(row[1:]):
            break  # a fact of an oscilloscope: HUnit, s
        if len(row) == width - 1 and not any(cells[-1] for cells in rows.cells):
            row.append("")  # a separator at the end of each row
        if len(row) == width + 1 and row[-1] == "Comment":
            row.pop()  # LabVIEW names a column that few rows have
        if len(row) != width:
            may_be_names = len(row) > 1 and rows.separator != " " and place >= skip
            if may_be_names and not (texts or values):
                raise ValueError(
                    f"line {place + 1} has {len(row)} names for {width} columns; with --skip "
                    f"{place + 1} they are #1 to #{width}"
                )
            break
        if (values and texts and not _is_fact(row)) or not (values or any(row)):
            break
        if not values and (any(map(_is_text, row)) or are_units(row)):
            texts.append((place, row))
    return texts


def _is_fact(row: Sequence[str]) -> bool:
    """Return whether a line tells one fact of each channel, as in `Name, x, Name, y`."""
    return len(row) > 2 and len({*row[::2]}) == 1 and _is_text(row[0])


def _columns(names: Sequence[str], labels: Collection[int]) -> dict[str, int]:
    """Return the places of columns by number, by name, and by name without a unit."""
    places = [place for place in range(len(names)) if place not in labels]
    columns = {f"#{number}": place for number, place in enumerate(places, start=1)}
    for names_of_columns in (names, map(without_unit, names)):
        for place, name in enumerate(names_of_columns):
            if name:
                columns.setdefault(name, place)
    return columns


def _cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without the blanks around them."""
    if separator == " ":
        line = " ".join(line.split())
    try:
        cells = next(
            csv.reader([line.strip("\r\n")], delimiter=separator, skipinitialspace=True), []
        )
    except csv.Error:
        return [line]
    return [cell.strip() for cell in cells]


def _is_value(cell: str) -> bool:
    return any(kind.fullmatch(cell) for kind in (NUMBER, TIME)) or unit_of(cell) != ""


def _is_text(cell: str) -> bool:
    return any(map(str.isalpha, cell)) and not _is_value(cell) and cell.lower() not in _NO_NUMBERS
