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
        later = {f"{SECOND}{name}": self._width + at for name, at in second.columns.items()}
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
        columns, clocks, starts = dict[int, Any](), set[int](), list[int | None]()
        for table, offset in zip(self._tables, (0, self._width), strict=True):
            own = [at for at in places if (at < self._width) == (offset == 0)]
            found = table.read([at - offset for at in own]) if own else []
            columns |= dict(zip(own, found, strict=True))
            clocks |= {at + offset for at in table.clocks}
            starts.append(table.start)
        first, second = starts
        for at in clocks:
            if at >= self._width and first is not None and second is not None:
                columns[at] = columns[at] + (second - first) / 1e9
        self.clocks = clocks
        return [columns[at] for at in places]

    @override
    def line(self, row: int) -> str:
        return self._tables[0].line(row)
