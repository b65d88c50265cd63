"""Ours against a peer: slices of both by turns in one run, medians, one small table."""

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from statistics import median

from stickslip_ros.versions import versions


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    what: str
    unit: str
    ours: float
    peer: float
    ratio: float
    """How many times better ours is; below 1 it is the peer that is better."""
    required: float | None = None
    """What the ratio has to be at least."""


def by_turns(rounds: int, *slices: Callable[[], float]) -> list[list[float]]:
    """Run the slices by turns, every other round backwards; return what each gave, by slice.

    Noise that lasts longer than a slice thus falls on all of them alike.
    """
    results: list[list[float]] = [[] for _ in slices]
    order = list(zip(slices, results, strict=True))
    for _ in range(rounds):
        for run, values in order:
            values.append(run())
        order.reverse()
    return results


def compare_rates(
    what: str, ours: Sequence[float], peer: Sequence[float], required: float | None = None
) -> Row:
    """Compare rates, 1/s, taken by turns: medians, and the median of the ratios of neighbours."""
    ratio = median(a / b for a, b in zip(ours, peer, strict=True))
    return Row(what, "1/s", median(ours), median(peer), ratio, required)


def compare_times(
    what: str, ours: Sequence[float], peer: Sequence[float], required: float | None = None
) -> Row:
    """Compare durations, s, taken by turns: medians, and the median of the ratios of neighbours."""
    ratio = median(b / a for a, b in zip(ours, peer, strict=True))
    return Row(what, "s", median(ours), median(peer), ratio, required)


def show(question: str | None, make_rows: Callable[[], list[Row]]) -> None:
    """Parse the command line of a benchmark, run it, print its table, or with --json its rows."""
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
        return
    width = max(len(f"{row.what}, {row.unit}") for row in rows)
    print(f"{'':{width}}  {'ours':>10}  {'peer':>10}  {'ratio':>8}  required")
    for row in rows:
        required = "" if row.required is None else f"{row.required:8g}"
        print(
            f"{f'{row.what}, {row.unit}':{width}}  {row.ours:10.4g}  {row.peer:10.4g}"
            f"  {row.ratio:8.3g}  {required}".rstrip()
        )
