"""Do slide and motor leave the guide as scipy's DOP853 says?

2,000 random drives of two bodies whose dry friction holds them at the guide and releases them, of
`benchmarks/random_releases.py`. The error is the largest difference of a position or a velocity
at an instant, in shares of the displacement and of the speed that static friction gives. A drive
whose motion is not followed, or has an error of 1e-9 or more, is listed with the difference of the
references of two tolerances.
"""

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from math import inf
from statistics import median
from typing import NamedTuple

import numpy as np

from benchmarks.random_releases import released
from stickslip_ros.errors import StickslipError

REQUIRED = 1e-9
DRIVES = 2000


class Result(NamedTuple):
    seed: int
    error: float
    reference_error: float = 0.0
    failure: str = ""


def compared(seed: int) -> Result:
    """Compare the motion of one drive with its reference."""
    drive = released(seed)
    expected = drive.solution()
    try:
        error = float(np.max(np.abs(drive.motion() - expected) / drive.ranges))
    except StickslipError as failure:
        return Result(seed, inf, failure=str(failure))
    if error < REQUIRED:
        return Result(seed, error)
    coarse = released(seed).solution(1e-12)
    return Result(seed, error, float(np.max(np.abs(coarse - expected) / drive.ranges)))


def main() -> int:
    """Run the study; return 1 if a motion differs from the reference."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.releases",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=DRIVES, help=f"default: {DRIVES}")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.workers) as pool:
        results = list(pool.map(compared, range(arguments.drives), chunksize=20))
    errors, listed = [each.error for each in results], [r for r in results if r.error >= REQUIRED]
    print(f"{len(results)} drives: error at most {max(errors):.2g}, median {median(errors):.2g}")
    print(*listed, sep="\n")
    return 1 if listed else 0


if __name__ == "__main__":
    sys.exit(main())
