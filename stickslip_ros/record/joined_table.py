"""Two tables of one run, each with a clock of its own."""

from collections.abc import Sequence
from typing import Any

from typing_extensions import override

from stickslip_ros.record.table_columns import SECOND, Table


class JoinedTable(Table):
    """A table, and a second one whose columns have `2:` before their names, as in `2:F`."""

    def __init__(self, first: Table, second: Table) -> None:
        """Take both tables."""
        self.path, self.form, self.period = first.path, first.form, first.period
        self.decimal = first.decimal
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

    @property
    @override
    def turns(self) -> tuple[str, Sequence[str]] | None:
        return self._tables[0].turns

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
