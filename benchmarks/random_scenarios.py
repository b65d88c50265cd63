"""Is what is said of a scenario the same however it is asked?

300 random scenarios of `tests/studies/random_scenarios.py`, each of them simulated again

- drawn, with its samples taken,
- with another share of normal force and friction coefficients in the same forces,
- mirrored,
- in other units of mass, length and time,
- with a bias force that moves the equilibrium,
- sampled twice as often,
- as a point of a sweep.

Regime, whether it is steady, and the numbers of its cycles must agree, the latter within what each
change leaves of them. Where the cycles that are measured are not the same ones, only steady motions
are compared.
"""

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from stickslip_ros.errors import StickslipError
from stickslip_ros.installed_packages import versions
from tests.studies.random_scenarios import CHANGES, differences, original

SCENARIOS = 300


class Result(NamedTuple):
    seed: int
    change: str
    differences: list[str]


def compared(seed: int) -> tuple[str, list[Result]]:
    """Return the regime of a scenario, and what each change alters."""
    results = list[Result]()
    for name in CHANGES:
        try:
            found = differences(seed, name)
        except StickslipError as error:
            found = [str(error)]
        results.append(Result(seed, name, found))
    _, measures = original(seed, CHANGES["drawn"].periods)
    return str(measures.regime), results


def report(results: Iterable[tuple[int, str, list[str]]], regimes: Mapping[str, int]) -> Any:
    """Return the JSON: how many of the scenarios differ by each change, and which."""
    made = [Result(*each) for each in results]
    differing = [each for each in made if each.differences]
    return {
        "scenarios": len({each.seed for each in made}),
        "regimes": dict(regimes),
        "by_change": {
            name: {
                "compared": sum(each.change == name for each in made),
                "differing": sum(each.change == name for each in differing),
            }
            for name in CHANGES
        },
        "differing": [each._asdict() for each in differing],
        "versions": versions(),
    }


def main() -> int:
    """Run the study; return 1 if an answer differs."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.random_scenarios",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--scenarios", type=int, default=SCENARIOS, help=f"default: {SCENARIOS}")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write JSON to this file")
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.workers) as pool:
        found = list(pool.map(compared, range(arguments.scenarios), chunksize=5))
    regimes = Counter(regime for regime, _ in found)
    made = report((each for _, results in found for each in results), regimes)
    print(json.dumps(made, indent=2))
    if arguments.out is not None:
        arguments.out.write_text(json.dumps(made, indent=2) + "\n", encoding="utf-8")
    return 1 if made["differing"] else 0


if __name__ == "__main__":
    sys.exit(main())
