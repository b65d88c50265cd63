"""Elements that the parts of the page share.

Text of others is data: it is never parsed as `props`, HTML or a script, which are literals.
"""

import json
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any

from nicegui import ui


@contextmanager
def card(title: str) -> Generator[None]:
    """Add a part of the page with a heading; further elements go into it."""
    with ui.element("section").classes("panel"):
        heading(2, title)
        yield


def heading(level: int, text: str) -> ui.element:
    """Add a heading, as readers of screens know it, and return it."""
    with ui.element(f"h{level}").classes("font-bold") as added:
        ui.label(text)
    return added


def named(element: Any, name: str) -> Any:
    """Give an element a name for readers of screens, and return it."""
    element.props["aria-label"] = name
    return element


def chart(options: dict[str, Any], name: str) -> ui.echart:
    """Add a chart with a name for readers of screens, and return it."""
    return named(ui.echart(options).classes("relative w-full chart").props("role=img"), name)


def table(**headings: str) -> ui.table:
    """Add an empty table with columns by name; the first tells its rows apart."""
    columns = [
        {"name": name, "label": heading, "field": name, "align": "left"}
        for name, heading in headings.items()
    ]
    added = ui.table(columns=columns, rows=[], row_key=columns[0]["name"])
    return added.classes("w-full").props("wrap-cells flat dense hide-bottom")


def show_commands(commands: Sequence[str]) -> None:
    """Add commands for a terminal."""
    with ui.row().classes("w-full no-wrap items-start commands"):
        ui.label("\n".join(commands)).classes("grow")
        copy = ui.button(icon="content_copy").props("flat round size=sm")
        copy.on("click", js_handler="(event) => stickslip.copy(event)")
        named(copy, "copy")


def call(function: str, *arguments: Any) -> None:
    """Run a function of page.js on the page; its arguments are data."""
    ui.run_javascript(f"stickslip.{function}({', '.join(map(json.dumps, arguments))})")
