"""Tables of text, as a terminal, a pipe and a notebook show them."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

from stickslip_ros.text import printable


class TextTable(NamedTuple):
    """A table of text; without any heading it has no row of headings."""

    title: str
    headings: Sequence[str]
    rows: Iterable[Sequence[str]]

    def lines(self) -> list[str]:
        """Return the title and each row as one line, the columns two spaces or more apart."""
        from rich.cells import cell_len, set_cell_size

        title, headings, rows = self.printable()
        lines = [headings, *rows] if any(headings) else [*rows]
        widths = [max(map(cell_len, column)) for column in zip(*lines, strict=True)]
        aligned = (
            "  ".join([*map(set_cell_size, line[:-1], widths), line[-1]]).rstrip() for line in lines
        )
        return [*filter(None, [title]), *aligned]

    def printable(self) -> Self:
        """Return the table with control characters as escape sequences."""
        headings, *rows = ([*map(printable, row)] for row in (self.headings, *self.rows))
        return self._replace(title=printable(self.title), headings=headings, rows=rows)
