"""How values are printed: tables on standard output, in SI units with suitable prefixes."""

import json
import os
import re
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING, Any, Protocol

from stickslip_ros.installed_packages import versions
from stickslip_ros.tables import TextTable
from stickslip_ros.text import finite, printable

if TYPE_CHECKING:
    from rich.console import Console


_JUDGING_TIME, _LONG_TIME = 3.0, 60.0
"""Time after which a work may seem long, and the length of a long one, s."""
_WARM, _KNOWN = 0.125, 0.25
"""Shares of a work after which its pace counts, and after which the time left is known."""
_LINE_INTERVAL = 10.0
"""Time between two lines of progress, s."""

_FRAME = 3
"""Characters that the frame of a column takes, beside one for the whole table."""
_STYLES = {
    "EQUILIBRIUM": "green",
    "STICK_SLIP": "yellow",
    "PURE_SLIP": "yellow",
    "UNBOUNDED": "red",
}
"""Style of the cells that are highlighted on a terminal, by regime."""


class Progress(Protocol):
    """Shows how much is done, and what is done next if the label changes."""

    def __call__(self, done: float, label: str | None = None) -> None:
        """Show the progress."""
        ...


def tell(sentence: str) -> None:
    """Tell a person, if there still is one: a terminal that was closed does not end a command."""
    with suppress(OSError):
        print(printable(sentence), file=sys.stderr)


def coloured(help_text: str) -> str:
    """Return a help with headings, names and options in colour, if it is read on a terminal.

    With the environment variable NO_COLOR it stays as it is.
    """
    if not sys.stdout.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return help_text
    text = re.sub(r"(?m)^(usage:|example:|[\w ]+:$)", "\033[1;34m\\1\033[0m", help_text)
    text = re.sub(r"(?<![\w-])--?[a-z][\w-]*", "\033[36m\\g<0>\033[0m", text)
    return re.sub(r"(?m)^  ([A-Za-z]+)(?=\s)", "  \033[32m\\1\033[0m", text)


def print_json(values: Mapping[str, Any]) -> None:
    """Print one JSON object, with null for what is not finite, and the versions in use."""
    json.dump(finite({**values, "versions": versions()}), sys.stdout, indent=2, allow_nan=False)
    print()


def print_parts(*parts: TextTable | str) -> None:
    """Print tables and sentences, one after the other.

    Tables are framed on a terminal. In a pipe or a file they are aligned plain text: each row is
    one line whatever its length, the columns two spaces or more apart.
    """
    for part in parts:
        if isinstance(part, str):
            print(printable(part))
        elif sys.stdout.isatty():
            from rich.console import Console

            title, headings, rows = part
            shown = [[printable(cell) for cell in row] for row in (headings, *rows)]
            _print_framed(Console(), printable(title), shown[0], shown[1:])
        else:
            for line in part.lines():
                print(line)


@contextmanager
def progress_bar(
    label: str, total: float | None, advice: str = "", *, lines: bool = False, even: bool = True
) -> Generator[Progress]:
    """Show progress towards `total` on standard error, if that is a terminal, or in `lines`.

    Once a quarter of a work is done whose parts are alike, `even`, a sentence says how long the
    rest will take if that is long. If it seems to be, the `advice` on what is quicker comes first.
    """
    left = _TimeLeft(label, total, advice, even)
    if not sys.stderr.isatty():
        with _telling(label) if lines else nullcontext([label]) as said:

            def follow(done: float, label: str | None = None) -> None:
                left.after(done)
                said[0] = label or said[0]

            yield follow
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    text, rest = (
        TextColumn(f"{{task.{name}}}", markup=False) for name in ("description", "fields[left]")
    )
    columns = (text, BarColumn(), TimeElapsedColumn(), rest)
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(printable(label), total=total, left="")

        def update(done: float, label: str | None = None) -> None:
            described = None if label is None else printable(label)
            bar.update(task, completed=done, description=described, left=left.after(done))

        yield update


class _TimeLeft:
    """How long a work will take, by the time of what is done but its begin, which compiles."""

    def __init__(self, label: str, total: float | None, advice: str, even: bool) -> None:
        self._label, self._total, self._advice, self._even = label, total, advice, even
        self._begin: tuple[float, float] | None = None
        self._warm: tuple[float, float] | None = None
        self._is_told = False

    def after(self, done: float) -> str:
        """Return the time left in words, "" while it is a guess; tell it once if it is long."""
        now = monotonic()
        start, first = self._begin = self._begin or (now, done)
        if self._total is None or not first < done < self._total:
            return ""
        share, passed = (done - first) / (self._total - first), now - start
        likely = passed * (1.0 - share) / share
        if self._advice and passed >= _JUDGING_TIME and likely > _LONG_TIME:
            tell(f"{self._label}{self._advice}")
            self._advice = ""
        if self._warm is None and share >= _WARM:
            self._warm = now, share
        if not self._even or self._warm is None or share < max(_KNOWN, self._warm[1] + _WARM):
            return ""
        since, at = self._warm
        left = (now - since) * (1.0 - share) / (share - at)
        if left <= _LONG_TIME:
            return f"about {left:.0f} s more"
        text = f"about {left / 60.0:.0f} min more"
        if not self._is_told:
            tell(f"{self._label}: {text}")
            self._is_told = True
        return text


@contextmanager
def _telling(label: str) -> Generator[list[str]]:
    """Tell every ten seconds what is done, and for how long; provide the place of its label."""
    said, begin, ended = [label], monotonic(), Event()

    def follow() -> None:
        while not ended.wait(_LINE_INTERVAL):
            tell(f"{said[0]}, {monotonic() - begin:.0f} s")

    follower = Thread(target=follow, daemon=True)
    follower.start()
    try:
        yield said
    finally:
        ended.set()
        follower.join()  # no line of progress behind the result


def _print_framed(
    console: "Console", title: str, headings: list[str], rows: list[list[str]]
) -> None:
    """Print a table with its first column to the left and the others to the right.

    Where the columns would not fit, each row becomes a table of its own.
    """
    from rich.cells import cell_len
    from rich.table import Table
    from rich.text import Text

    from stickslip_ros.measures.cycle_measures import Regime

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
    styles = {Regime.label(Regime[name]): style for name, style in _STYLES.items()}
    for row in rows:
        table.add_row(*(Text(cell, styles.get(re.split(r" \(|,", cell)[0], "")) for cell in row))
    console.print(table)
