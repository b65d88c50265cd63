"""How values are printed: tables on standard output, in SI units with suitable prefixes."""

import json
import sys
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from stickslip_ros.text import printable

if TYPE_CHECKING:
    from rich.console import Console

    from stickslip_ros.plots.units import Units

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
    "peak_applied_force": ("peak control force acting", "N"),
    "resting_force": ("final control force", "N"),
    "resting_applied_force": ("final control force acting", "N"),
    "samples": ("samples", ""),
    "lost_samples": ("lost samples", ""),
    "late_forces": ("late forces", ""),
    "dropped_forces": ("dropped forces", ""),
    "missed_deadlines": ("missed deadlines", ""),
    "steps_per_second": ("steps per second", ""),
    "duration": ("duration", "s"),
    "complete": ("bag complete", ""),
    "bag": ("bag", ""),
}

_SENT = {
    "peak_force": ("peak_applied_force", "peak control force sent"),
    "resting_force": ("resting_applied_force", "final control force sent"),
}
"""The measure of the force that acted, and the label of the sent force where the two differ."""

_SAME_SCALE = {
    "amplitude": "midpoint",
    "midpoint": "amplitude",
    "resting_force": "peak_force",
    "resting_applied_force": "peak_applied_force",
}
"""The quantity with which a value is compared to see whether it is rounding error."""

_ALL_SI: Mapping[str, "Units"] = {}

_FRAME = 3
"""Characters that the frame of a column takes, beside one for the whole table."""


def print_json(values: Mapping[str, Any]) -> None:
    """Print one JSON object, with null for what is not finite."""
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


def print_figures(
    title: str, columns: Mapping[str, Mapping[str, Any]], units: Mapping[str, "Units"] = _ALL_SI
) -> None:
    """Print values by name, one column for each of `columns`.

    `units` are those of each column, by its name; without it is in SI.
    """
    rows = {
        name: [label, *_row(name, unit, columns, units)]
        for name, (label, unit) in _LABELS.items()
        if any(name in values for values in columns.values())
    }
    _tell_apart(rows, columns)
    print_table(title, ["", *columns], rows.values())


def _tell_apart(rows: dict[str, list[str]], columns: Mapping[str, Mapping[str, Any]]) -> None:
    """Omit the force that acted if it is unknown or equals the sent one, and drops without any."""
    for sent, (applied, label) in _SENT.items():
        known = [values.get(applied) is not None for values in columns.values()]
        cells = zip(known, rows.get(sent, [])[1:], rows.get(applied, [])[1:], strict=False)
        if any(is_known and of_sent != of_applied for is_known, of_sent, of_applied in cells):
            rows[sent][0] = label
        else:
            rows.pop(applied, None)
    if not any(values.get("dropped_forces") for values in columns.values()):
        rows.pop("dropped_forces", None)


def _row(
    name: str, unit: str, columns: Mapping[str, Mapping[str, Any]], units: Mapping[str, "Units"]
) -> list[str]:
    """Return the cells of one row; columns in the same units have the same prefix."""
    from stickslip_ros.plots.units import SI

    cells: dict[str, str] = {}
    for shown_in in {units.get(column, SI) for column in columns}:
        own = [column for column in columns if units.get(column, SI) == shown_in]
        values = [_shown(name, columns[column]) for column in own]
        others = [columns[column].get(_SAME_SCALE.get(name, "")) for column in own]
        largest = max((abs(value) for value in others if value is not None), default=0.0)
        cells |= zip(own, shown_in.texts(values, unit, largest=largest), strict=True)
    return [cells[column] for column in columns]


def _shown(name: str, values: Mapping[str, Any]) -> Any:
    """Return the value to print; for a regime also whether it is steady."""
    from stickslip_ros.physics.measures.cycle_measures import Regime, with_trend
    from stickslip_ros.plots.units import NOISE

    value = values.get(name)
    if name == "regime":
        return with_trend(Regime.label(value), values.get("trend"))
    if name == "velocity_amplitude" and value is not None:
        amplitude, midpoint = values.get("amplitude") or 0.0, values.get("midpoint") or 0.0
        return (
            0.0 if amplitude <= NOISE * abs(midpoint) else value
        )  # the remainder is rounding error
    return value


def print_table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table: framed on a terminal, aligned plain text into a pipe or a file.

    In plain text each row is one line whatever its length, the columns two spaces or more apart.
    """
    shown = [[printable(cell) for cell in row] for row in (headings, *rows)]
    if sys.stdout.isatty():
        from rich.console import Console

        _print_framed(Console(), printable(title), shown[0], shown[1:])
        return
    from rich.cells import cell_len, set_cell_size

    if title:
        print(printable(title))
    lines = shown if any(headings) else shown[1:]
    widths = [max(map(cell_len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        padded = map(set_cell_size, line[:-1], widths)
        print("  ".join([*padded, line[-1]]).rstrip())


@contextmanager
def progress_bar(label: str, total: float | None) -> Generator[Callable[[float], None]]:
    """Show progress towards `total` on standard error if that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    text = TextColumn("{task.description}", markup=False)
    columns = (text, BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(printable(label), total=total)
        yield lambda done: bar.update(task, completed=done)


def _print_framed(
    console: "Console", title: str, headings: list[str], rows: list[list[str]]
) -> None:
    """Print a table with its first column to the left and the others to the right.

    Where the columns would not fit, each row becomes a table of its own.
    """
    from rich.cells import cell_len
    from rich.table import Table
    from rich.text import Text

    if title:
        console.print(Text(title, "table.title"), soft_wrap=True)
    labels, *columns = zip(headings, *rows, strict=True)
    side_by_side = len(columns) > 1
    share = max(1, console.width // len(headings) - _FRAME)
    table = Table(show_header=any(headings))
    table.add_column(Text(headings[0]), overflow="fold")
    least = max(map(cell_len, " ".join(labels).split()), default=0) + _FRAME + 1
    for heading, *cells in columns:
        width = max(map(cell_len, cells), default=0)
        lines = Text(heading).wrap(console, max(width, share), overflow="fold")
        least += max(width, *(line.cell_len for line in lines), 0) + _FRAME
        header = Text("\n").join(lines)
        table.add_column(header, justify="right", overflow="fold", no_wrap=side_by_side)
    if side_by_side and least > console.width:
        for label, *cells in rows:
            fields = [list(field) for field in zip(headings[1:], cells, strict=True)]
            _print_framed(console, f"{headings[0]} {label}".strip(), ["", ""], fields)
        return
    styles = _styles()
    for row in rows:
        table.add_row(*(Text(cell, styles.get(cell.partition(",")[0], "")) for cell in row))
    console.print(table)


def _styles() -> dict[str, str]:
    """Return the style of each cell that is highlighted on a terminal."""
    from stickslip_ros.physics.measures.cycle_measures import Regime

    return {
        Regime.label(Regime.EQUILIBRIUM): "green",
        Regime.label(Regime.STICK_SLIP): "yellow",
        Regime.label(Regime.PURE_SLIP): "yellow",
        Regime.label(Regime.UNBOUNDED): "red",
    }
