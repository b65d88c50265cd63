"""Tables of text, as a terminal, a pipe and a notebook show them."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

from stickslip_ros.text import printable


class TextTable(NamedTuple):
    """A table of text; without any heading it has no row of headings."""

    title: str
    headings: Sequence[str]
    rows: Iterable[Sequence[str]]

    def lines(self) -> list[str]:
        """Return the title and each row as one line, the columns two spaces or more apart."""
        from rich.cells import cell_len, set_cell_size

        shown = self._printable()
        lines = shown if any(self.headings) else shown[1:]
        widths = [max(map(cell_len, column)) for column in zip(*lines, strict=True)]
        aligned = (
            "  ".join([*map(set_cell_size, line[:-1], widths), line[-1]]).rstrip() for line in lines
        )
        return [*filter(None, [printable(self.title)]), *aligned]

    def html(self) -> str:
        """Return the table as HTML, without styles of its own."""
        headings, *rows = ([escape(cell) for cell in row] for row in self._printable())
        parts = [f"<caption>{escape(printable(self.title))}</caption>"] if self.title else []
        if any(headings):
            parts.append(f"<thead>{_row(headings, 'th')}</thead>")
        parts += ["<tbody>", *(_row(row, "td") for row in rows), "</tbody>"]
        return f"<table>{''.join(parts)}</table>"

    def _printable(self) -> list[list[str]]:
        return [[printable(cell) for cell in row] for row in (self.headings, *self.rows)]


def _row(cells: Sequence[str], tag: str) -> str:
    """Return a row of HTML, its first cell to the left as a label, the others to the right."""
    styles = ("left", *["right"] * (len(cells) - 1))
    return "".join(
        [
            "<tr>",
            *(
                f'<{tag} style="text-align: {style}">{cell}</{tag}>'
                for style, cell in zip(styles, cells, strict=True)
            ),
            "</tr>",
        ]
    )
