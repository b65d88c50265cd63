"""Tables as text: CSV files and their relatives, read by pandas once their form is found."""

import re
import warnings
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import replace
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import IntArray
from stickslip_ros.record.table_columns import Table, TableFormat
from stickslip_ros.record.text_cells import OtherMarkError, check_thousands, seconds, values_of
from stickslip_ros.record.text_form import form_of, opened

_MOST_NUMBERS, _CHUNK = 1 << 28, 1 << 18
"""Numbers in the columns that are used, and cells that are read at once."""
_SKIPPED = re.compile(r"Skipping line (\d+)")


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
        self.path, self.form = path, given
        self._converted = content, notes
        with opened(path, content) as stream:
            self._text = text = form_of(stream, given)
        self.names, self.columns, self.units = text.names, text.columns, text.units
        self.period, self.remarks, self.turns = text.period, text.remarks, text.turns
        self._refused: Sequence[int] = ()
        self._rows: IntArray | None = None
        """Lines of the rows that were read, from that of the first one; None: all."""
        self._marks: dict[str, str] = {}
        """What marks in the cells were read as."""

    @property
    @override
    def notes(self) -> list[str]:
        features, notes = self._text.features(self._marks.values()), [*self._converted[1]]
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
        number = self._text.first + 1 + (row if self._rows is None else int(self._rows[row]))
        for refused in self._refused:
            number += refused <= number
        return f"line {number}"

    @override
    def read(self, places: Sequence[int]) -> list[Any]:
        """Return columns as arrays of shape (rows,); times become seconds from the first one."""
        try:
            return self._read(places)
        except OtherMarkError as error:  # what was read so far had another meaning
            self.form = replace(self.form, decimal=str(error))
            return self._read(places)

    def _read(self, places: Sequence[int]) -> list[Any]:
        import pandas as pd

        wanted, decimal, rows, count = self.wanted, self._text.decimal, list[IntArray](), 0
        parts: dict[int, list[Any]] = {place: [] for place in places}
        with closing(self._frames()) as frames:
            for frame in frames:
                count += len(frame)
                if count * len(places) > _MOST_NUMBERS:
                    raise ValueError(f"it has more than {_MOST_NUMBERS} numbers")
                if frame[places[0]].hasnans:
                    frame = frame[~frame.isna().all(axis=1)]
                if wanted is not None:
                    place, value, number = wanted
                    text = frame[place].astype(str).str.strip(" \t'\"")
                    same = pd.to_numeric(text, errors="coerce") == number
                    frame = frame[(text == value) | same]
                rows.append(frame.index.to_numpy())
                for place in places:
                    values, marks = values_of(frame[place], decimal, self.form.decimal)
                    parts[place].append(values)
                    self._marks = marks | self._marks
        self._rows = np.concatenate(rows)
        if wanted is not None and not len(self._rows):
            texts = (row[wanted[0]] for row in self._text.first_rows)
            raise self.nothing_where(wanted[0], texts)
        if len(self._rows) == count:
            self._rows = None
        self.clocks = {place for place in places if parts[place][0].dtype.kind in "mM"}
        return [self._joined(parts.pop(place)) for place in places]

    def _frames(self) -> Generator[Any]:
        import pandas as pd

        text = self._text
        version = tuple(map(int, pd.__version__.split(".")[:2]))
        # From 3.1 on this is the default, and naming it is deprecated.
        exact: Any = {} if version >= (3, 1) else {"float_precision": "round_trip"}
        with (
            opened(self.path, self._converted[0]) as stream,
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
                skipinitialspace=True,
                skip_blank_lines=False,
                on_bad_lines="warn",
                low_memory=False,
                chunksize=max(1, _CHUNK // text.width),
                **exact,
            )
            self._refused = []
            frame: Any = ()
            while frame is not None:
                with warnings.catch_warnings(record=True) as caught:
                    warnings.simplefilter("always")
                    frame = next(frames, None)
                skipped = re.findall(_SKIPPED, " ".join(str(warning.message) for warning in caught))
                self._refused += [text.first + int(number) for number in skipped]
                if frame is not None:
                    yield frame

    def _joined(self, parts: Sequence[Any]) -> Any:
        """Return the parts of a column as one; instants as seconds from the first of the table."""
        try:
            values = np.concatenate(parts)
        except TypeError:
            raise ValueError("a column has both numbers and times") from None
        if values.dtype.kind in "mM":
            values, self.start = seconds(values, self.start)
        elif self.form.decimal is None and values.dtype.kind == "f":
            check_thousands(values, self._text.decimal)
        return values
