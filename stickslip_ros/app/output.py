"""How figures are shown to a person: tables on standard output, SI with sensible prefixes."""

import json
import sys
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from stickslip_ros.prefixes import prefix_for
from stickslip_ros.printable import printable

_LABELS: dict[str, tuple[str, str]] = {
    "regime": ("regime", ""),
    "amplitude": ("amplitude", "m"),
    "velocity_amplitude": ("velocity amplitude", "m/s"),
    "midpoint": ("midpoint", "m"),
    "period": ("period", "s"),
    "frequency": ("frequency", "Hz"),
    "stick_fraction": ("stick fraction", ""),
    "cycles": ("cycles measured", ""),
    "multipliers": ("Floquet multipliers", ""),
    "peak_force": ("peak control force", "N"),
    "resting_force": ("control force at rest", "N"),
    "samples": ("samples", ""),
    "lost_samples": ("lost samples", ""),
    "late_forces": ("late forces", ""),
    "missed_deadlines": ("missed deadlines", ""),
    "steps_per_second": ("steps per second", ""),
    "duration": ("duration", "s"),
    "complete": ("bag complete", ""),
    "bag": ("bag", ""),
}


def print_json(values: Mapping[str, Any]) -> None:
    """Print one JSON object, of what `finite` makes of the values."""
    json.dump(finite(values), sys.stdout, indent=2, allow_nan=False)
    print()


def finite(value: Any) -> Any:
    """Return a value for JSON: null for what is infinite or not a number, which JSON lacks."""
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [finite(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value


def print_figures(title: str, columns: Mapping[str, Mapping[str, Any]]) -> None:
    """Print figures by name, one column for each of `columns`, those that nobody has left out."""
    rows: list[list[str]] = []
    for name, (label, unit) in _LABELS.items():
        if any(name in figures for figures in columns.values()):
            rows.append([label, *quantities([f.get(name) for f in columns.values()], unit)])
    print_table(title, ["", *columns], rows)


def print_table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of which the first column stands to the left and the others to the right."""
    table = Table(title=_shown(title), title_justify="left")
    for number, heading in enumerate(headings):
        table.add_column(_shown(heading), justify="right" if number else "left")
    for row in rows:
        table.add_row(*map(_shown, row))
    _Console(soft_wrap=True).print(table)


def quantities(values: Sequence[Any], unit: str, digits: int = 4) -> list[str]:
    """Return values to show with their unit, all with the SI prefix that suits the largest.

    A unit that begins with a number, such as 1/s, gets no prefix.
    """
    largest = max((abs(value) for value in values if isinstance(value, float)), default=0.0)
    scale, prefix = prefix_for(largest) if unit[:1].isalpha() else (1.0, "")
    return [_text(value, scale, f" {prefix}{unit}".rstrip(), digits) for value in values]


@contextmanager
def progress_bar(label: str, total: float | None) -> Generator[Callable[[float], None]]:
    """Show progress towards `total` on standard error while a person looks at it."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda done: None
        return
    text = TextColumn("{task.description}", markup=False)
    columns = (text, BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(printable(label), total=total)
        yield lambda done: bar.update(task, completed=done)


class _Console(Console):
    """Leaves it to the command to end where nobody reads on."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def _shown(text: str) -> str:
    """Return a text that rich shows as it is."""
    return escape(printable(text))


def _text(value: Any, scale: float, unit: str, digits: int) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value / scale:.{digits}g}{unit}" if isinstance(value, float) else str(value)
