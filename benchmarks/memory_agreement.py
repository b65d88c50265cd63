"""Do the motions of random drives whose friction has a memory agree with scipy's solvers?

Thirty drives for each law, every other one with friction by direction, on static laws of several
kinds as curves. `benchmarks/memory_reference.py` has the reference: the equations as
their sources have them, and events of its own. DOP853 solves them at rtol 1e-12. The motions last
20 natural periods, with 4 samples in each.

The error is the largest difference of position and of velocity at a sample, in shares of the range
that each has in the motion. The reference is compared with itself at a tolerance ten times as
large: where the two differ by more than the required accuracy, or where the reference takes more
than a minute, the drive is listed but does not count. The ratio is that of the processor times.
"""

import argparse
import json
import os
import signal
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import product
from math import inf, isfinite
from pathlib import Path
from statistics import median
from time import process_time
from timeit import Timer
from typing import Any

from benchmarks.memory_reference import LostError
from benchmarks.random_memory_drives import (
    LAWS,
    PERIODS,
    SAMPLES,
    STORED_EVERY,
    random_memory_drive,
)
from stickslip_ros.errors import StickslipError
from stickslip_ros.installed_packages import versions

REQUIRED = dict.fromkeys(LAWS, 1e-8)
RTOL = dict.fromkeys(LAWS, 1e-12)
DRIVES = 30
STORED = 5
LIMIT = 60
"""Processor time, s, of a reference."""


@dataclass(frozen=True)
class Result:
    law: str
    seed: int
    error: float = inf
    reference_error: float = inf
    """Difference between the references of two tolerances."""
    ratio: float = 0.0
    """Processor time of the reference divided by that of the motion."""
    failure: str = ""

    @property
    def counts(self) -> bool:
        return self.reference_error <= REQUIRED[self.law]

    @property
    def agrees(self) -> bool:
        return self.error < REQUIRED[self.law]


def _stop(*_: Any) -> None:
    raise LostError(f"takes more than {LIMIT} s")


def compared(case: tuple[str, int]) -> tuple[Result, list[list[float]]]:
    """Compare the motion of one drive with its reference; return the reference, too."""
    law, seed = case
    drive = random_memory_drive(law, seed)
    signal.signal(signal.SIGVTALRM, _stop)
    try:
        signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT)
        start = process_time()
        expected = drive.reference(RTOL[law])
        slow = process_time() - start
        coarse = drive.reference(10.0 * RTOL[law])
    except (LostError, ArithmeticError, ValueError) as error:
        return Result(law, seed, failure=f"reference: {error}"), []
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    own = drive.error(coarse, expected)
    try:
        found = drive.motion()  # compiles
        times, quick = Timer(drive.motion, timer=process_time).autorange()
    except StickslipError as error:
        return Result(law, seed, reference_error=own, failure=str(error)), []
    result = Result(law, seed, drive.error(found, expected), own, slow / quick * times)
    return result, expected[::STORED_EVERY].tolist()


def summary(results: list[Result]) -> dict[str, Any]:
    counted = [each for each in results if each.counts]
    errors = [each.error for each in counted]
    return {
        "drives": len(results),
        "compared": len(counted),
        "worst_error": _rounded(max(errors, default=inf)),
        "median_error": _rounded(median(errors) if errors else inf),
        "required": REQUIRED[results[0].law],
        "agree": sum(each.agrees for each in counted),
        "median_time_ratio": _rounded(median(each.ratio for each in counted) if counted else 0.0),
        "least_time_ratio": _rounded(min((each.ratio for each in counted), default=0.0)),
    }


def _rounded(value: float) -> float | None:
    return float(f"{value:.3g}") if isfinite(value) else None


def _listed(result: Result) -> dict[str, Any]:
    return {
        name: _rounded(value) if isinstance(value, float) else value
        for name, value in asdict(result).items()
    }


def report(results: list[Result]) -> dict[str, Any]:
    """Return the JSON: a summary of each law, and the drives that stand out."""
    return {
        "periods": PERIODS,
        "samples_per_period": SAMPLES,
        "rtol": RTOL,
        "by_law": {law: summary([each for each in results if each.law == law]) for law in LAWS},
        "reference_not_accurate": [_listed(each) for each in results if not each.counts],
        "differing": [_listed(each) for each in results if each.counts and not each.agrees],
        "versions": versions(),
    }


def main() -> int:
    """Run the study; return 1 if a motion differs from an accurate reference."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.memory_agreement",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=DRIVES, help="for each law (default: 30)")
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=LAWS)
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write JSON to this file")
    parser.add_argument("--store", type=Path, metavar="FILE", help="write references for the tests")
    arguments = parser.parse_args()
    cases = list(product(arguments.laws, range(arguments.drives)))
    with ProcessPoolExecutor(arguments.workers) as pool:
        found = list(pool.map(compared, cases))
    results = [result for result, _ in found]
    for each in results:
        print(each)
    table = {law: summary([e for e in results if e.law == law]) for law in arguments.laws}
    for law, row in table.items():
        print(law, row)
    if arguments.out is not None:
        text = json.dumps(report(results), indent=2)
        arguments.out.write_text(text + "\n", encoding="utf-8")
    if arguments.store is not None:
        stored: dict[str, Any] = {law: {} for law in LAWS}
        for result, states in found:
            if result.counts and len(stored[result.law]) < STORED:
                stored[result.law][str(result.seed)] = states
        arguments.store.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
    return 1 if any(each.counts and not each.agrees for each in results) else 0


if __name__ == "__main__":
    sys.exit(main())
