"""Compare ours with peers: slices of all run in turns, medians, one table."""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import NoReturn, TypeVar

from stickslip_ros.installed_packages import versions

T = TypeVar("T")

LACKING = 77
"""Exit status of a benchmark that cannot run here; the common status of skipped tests."""


@dataclass(frozen=True)
class Row:
    """One line of the table: our value, and the value of a peer."""

    what: str
    unit: str = ""
    ours: float | None = None
    against: str = ""
    """Name of the peer; empty if there is none."""
    peer: float | None = None
    ratio: float | None = None
    """How many times better ours is; below 1, the peer is better."""
    required: float | None = None
    """Lower limit of the ratio that must be met."""
    aim: float | None = None
    """Lower limit of the ratio that should be met."""
    failure: str = ""
    """Why what this row is about failed; it has no values then."""


def by_turns(rounds: int, *slices: Callable[[], T]) -> list[list[T]]:
    """Run the slices in turns, every other round backwards; return the results by slice.

    Noise that lasts longer than a slice therefore affects all of them equally.
    """
    results: list[list[T]] = [[] for _ in slices]
    order = list(zip(slices, results, strict=True))
    for _ in range(rounds):
        for run, values in order:
            values.append(run())
        order.reverse()
    return results


def compare_rates(
    what: str,
    ours: Sequence[float],
    against: str,
    peer: Sequence[float],
    *,
    required: float | None = None,
    aim: float | None = None,
) -> Row:
    """Compare rates, 1/s, measured in turns: medians, and the median ratio of neighbours."""
    ratio = median(a / b for a, b in zip(ours, peer, strict=True))
    return Row(what, "1/s", median(ours), against, median(peer), ratio, required, aim)


def compare_times(
    what: str,
    ours: Sequence[float],
    against: str,
    peer: Sequence[float],
    *,
    required: float | None = None,
) -> Row:
    """Compare durations, s, measured in turns: medians, and the median ratio of neighbours."""
    ratio = median(b / a for a, b in zip(ours, peer, strict=True))
    return Row(what, "s", median(ours), against, median(peer), ratio, required)


def lacks(what: str) -> NoReturn:
    """End a benchmark because a requirement is not installed."""
    print(f"this needs {what}", file=sys.stderr)
    sys.exit(LACKING)


def show(question: str | None, make_rows: Callable[[], list[Row]]) -> None:
    """Parse the command line of a benchmark, run it, and print its table, or its rows as JSON."""
    parser = argparse.ArgumentParser(
        description=question, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object and nothing else"
    )
    as_json = parser.parse_args().json
    rows = make_rows()
    if as_json:
        print(json.dumps({"rows": [asdict(row) for row in rows], "versions": versions()}, indent=2))
    else:
        print(table({"": rows}))
    if any(row.failure for row in rows):
        sys.exit(1)


def table(sections: dict[str, list[Row]]) -> str:
    """Return rows as text, each section below its title; ratios below their limit are marked."""
    lines: list[tuple[str, ...]] = [("", "ours", "peer", "", "ratio", "at least")]
    for title, rows in sections.items():
        if title:
            lines += [("", "", "", "", "", ""), (title.upper(), "", "", "", "", "")]
        lines += [_cells(row) for row in rows]
    full = [cells for cells in lines if len(cells) > 1]
    widths = [max(map(len, column)) for column in zip(*full, strict=True)]
    return "\n".join(_line(cells, widths) for cells in lines)


def _cells(row: Row) -> tuple[str, ...]:
    if row.failure:
        return (f"{row.what} failed: {row.failure}",)
    goal = row.aim if row.required is None else row.required
    at_least = ""
    if row.ratio is not None and goal is not None:
        kind = " (aim)" if row.required is None else ""
        at_least = f"{goal:.3g}{kind}{'  SHORT' if row.ratio < goal else ''}"
    return (
        f"{row.what}, {row.unit}" if row.unit else row.what,
        _number(row.ours),
        _number(row.peer),
        row.against,
        _number(row.ratio, 3),
        at_least,
    )


def _number(value: float | None, digits: int = 4) -> str:
    if value is None:
        return ""
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.{digits}g}"


def _line(cells: Iterable[str], widths: Iterable[int]) -> str:
    columns = zip(cells, "<>><><", widths, strict=False)
    return "  ".join(f"{text:{align}{width}}" for text, align, width in columns).rstrip()
