"""Do the motions of random drives agree with scipy's DOP853?

Thirty drives for each friction law and each course, without and with friction by direction in
turns. The course acts on the belt, on the load, as a disturbance, or on one of them while courses
of other kinds act on the other two. `benchmarks/dop853.py` has the reference: the same
equations, written again, with events of its own, at rtol 1e-13. The motions last 20 natural
periods, with 20 samples in each.

The error is the largest difference of position and of velocity at a sample, in shares of the
range that each has in the motion. The error of an event is that of the time at which a phase of
stick starts or ends, in natural periods. The reference is compared with itself at rtol 1e-12: where
these two differ by more than 1e-8, it is not accurate, and the drive is listed but does not count.
"""

import argparse
import json
import os
import sys
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import product
from math import inf, isfinite
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.dop853 import LostError
from benchmarks.random_drives import (
    KINDS,
    LAWS,
    PERIODS,
    PLACES,
    SAMPLES,
    difference,
    drive_of_place,
    sticks_of,
)
from stickslip_ros.errors import StickslipError
from stickslip_ros.installed_packages import versions

REQUIRED = 1e-7
ACCURATE = 1e-8
RTOL, COARSE_RTOL = 1e-13, 1e-12
DRIVES = 30


@dataclass(frozen=True)
class Case:
    law: str
    kind: str
    place: str
    seed: int


@dataclass(frozen=True)
class Result:
    law: str
    kind: str
    place: str
    seed: int
    error: float
    event_error: float
    reference_error: float
    """Difference between the references of two tolerances."""
    sticks: int
    """Number of phases of stick."""
    failure: str = ""
    """Why there is no comparison."""

    @property
    def counts(self) -> bool:
        return self.reference_error <= ACCURATE

    @property
    def agrees(self) -> bool:
        return max(self.error, self.event_error) < REQUIRED


def cases(drives: int) -> list[Case]:
    """Return the drives; each place gets as many of each law, course and kind of friction."""
    return [
        Case(law, kind, PLACES[(seed // 2 + i + j) % len(PLACES)], seed)
        for (i, law), (j, kind), seed in product(enumerate(LAWS), enumerate(KINDS), range(drives))
    ]


def compared(case: Case) -> Result:
    """Compare the motion of one drive with its reference."""
    drive = drive_of_place(case.seed, case.law, case.kind, case.place)
    try:
        reference = drive.solution(rtol=RTOL)
        coarse = drive.solution(rtol=COARSE_RTOL, longest_step=0.07)
    except LostError as error:
        return Result(**asdict(case), **_nothing(f"reference: {error}"))
    states = np.column_stack([coarse.position, coarse.velocity])
    own = difference(drive, reference, states, coarse.sticks)
    try:
        found, breakpoints = drive.motion()
    except StickslipError as error:
        return Result(**asdict(case), **_nothing(str(error)) | {"reference_error": own.state})
    ours = difference(drive, reference, found, sticks_of(breakpoints))
    return Result(
        **asdict(case),
        error=ours.state,
        event_error=ours.events,
        reference_error=max(own.state, own.events),
        sticks=ours.sticks,
    )


def _nothing(failure: str) -> dict[str, Any]:
    return {
        "error": inf, "event_error": inf, "reference_error": inf, "sticks": 0, "failure": failure,
    }  # fmt: skip


def summary(results: Iterable[Result]) -> dict[str, Any]:
    """Return worst and median of results."""
    results = list(results)
    counted = [each for each in results if each.counts]
    errors, events = (
        [getattr(each, name) for each in counted] for name in ("error", "event_error")
    )
    return {
        "drives": len(results),
        "compared": len(counted),
        "worst_error": _finite(max(errors, default=inf)),
        "median_error": _finite(median(errors) if errors else inf),
        "worst_event_error": _finite(max(events, default=inf)),
        "sticks": sum(each.sticks for each in counted),
        "agree": sum(each.agrees for each in counted),
    }


def _finite(value: float) -> float | None:
    return float(f"{value:.3g}") if isfinite(value) else None


def report(results: list[Result]) -> dict[str, Any]:
    """Return the JSON: a summary of all, by law and course, and the drives that stand out."""
    groups = {"law": LAWS, "kind": KINDS, "place": PLACES}
    inaccurate = [each for each in results if not each.counts]
    differing = [each for each in results if each.counts and not each.agrees]
    return {
        "periods": PERIODS,
        "samples_per_period": SAMPLES,
        "rtol": [RTOL, COARSE_RTOL],
        "required": REQUIRED,
        "all": summary(results),
        **{
            f"by_{group}": {
                name: summary(each for each in results if getattr(each, group) == name)
                for name in names
            }
            for group, names in groups.items()
        },
        "by_law_and_kind": {
            f"{law}, {kind}": summary(
                each for each in results if (each.law, each.kind) == (law, kind)
            )
            for law, kind in product(LAWS, KINDS)
        },
        "reference_not_accurate": [_listed(each) for each in inaccurate],
        "differing": [_listed(each) for each in differing],
        "versions": versions(),
    }


def _listed(result: Result) -> dict[str, Any]:
    return {
        name: _finite(value) if isinstance(value, float) else value
        for name, value in asdict(result).items()
    }


def table(found: dict[str, Any]) -> str:
    """Return the summaries as text."""
    lines = [
        f"{'':24}{'drives':>7}{'compared':>9}{'worst':>9}{'median':>9}{'events':>9}{'sticks':>8}"
    ]
    rows = {"all": found["all"]}
    for group in ("law", "kind", "place"):
        rows |= {f"{group} {name}": row for name, row in found[f"by_{group}"].items()}
    for name, row in rows.items():
        values = [row[key] for key in ("worst_error", "median_error", "worst_event_error")]
        shown = "".join(f"{'-' if each is None else format(each, '.1e'):>9}" for each in values)
        lines.append(f"{name:24}{row['drives']:>9}{row['compared']:>9}{shown}{row['sticks']:>9}")
    for key in ("reference_not_accurate", "differing"):
        lines += [f"{key}: {each}" for each in found[key]]
    return "\n".join(lines)


def main() -> int:
    """Run the study; return 1 if a motion differs from an accurate reference."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.agreement",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--drives", type=int, default=DRIVES, help=f"for each law and course (default: {DRIVES})"
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write JSON to this file")
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.workers) as pool:
        results = list(pool.map(compared, cases(arguments.drives), chunksize=6))
    found = report(results)
    print(table(found))
    if arguments.out is not None:
        arguments.out.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return 1 if found["differing"] else 0


if __name__ == "__main__":
    sys.exit(main())
