"""How results print: as tables in a terminal and in a notebook, with figures beside them."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from functools import partial
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from stickslip_ros.tables import TextTable
from stickslip_ros.text import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Parts = Iterable[TextTable | str]
"""Tables and sentences that a result prints as."""


class Shown(ABC):
    """A result that prints as tables: plain text in a terminal, HTML in a notebook."""

    @abstractmethod
    def _parts(self) -> Parts:
        """Return the tables and sentences."""

    def __repr__(self) -> str:
        return "\n".join(
            printable(part) if isinstance(part, str) else "\n".join(part.lines())
            for part in self._parts()
        )

    def _repr_html_(self) -> str:
        return "\n".join(
            f"<p>{escape(printable(part))}</p>" if isinstance(part, str) else part.html()
            for part in self._parts()
        )


def shown_in_notebooks(figure: "Figure") -> "Figure":
    """Let a notebook show a figure that pyplot does not know, and return it."""
    vars(figure)["_repr_png_"] = partial(_png, figure)
    return figure


def _png(figure: "Figure") -> bytes:
    stream = BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()
