"""Elements that the parts of the page share."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any

from nicegui import ui


@contextmanager
def card(title: str) -> Generator[None]:
    """Add a part of the page with a heading; further elements go into it."""
    with ui.element("section").classes("panel"):
        heading(2, title, "font-bold")
        yield


def heading(level: int, text: str, classes: str) -> None:
    """Add a heading, as readers of screens know it."""
    with ui.element(f"h{level}").classes(classes):
        ui.label(text)


def chart(options: dict[str, Any], text: str, classes: str = "") -> ui.echart:
    """Add a chart with a name for readers of screens, and return it."""
    drawn = ui.echart(options).classes(f"relative w-full chart {classes}")
    return drawn.props(f'role=img aria-label="{text}"')


def show_commands(commands: Sequence[str]) -> None:
    """Add commands for a terminal."""
    shown = ui.code("\n".join(commands), language="bash").classes("w-full")
    shown.copy_button.props('aria-label="copy"')


def call(script: str) -> None:
    """Run a function of page.js on the page."""
    ui.run_javascript(f"stickslip.{script}")
