"""Findings and predictions of `stickslip identify` on a real axis.

The ball-screw axis EMPS (A. Janot, M. Gautier, M. Brunot, Data set and reference models of EMPS,
Workshop on Nonlinear System Identification Benchmarks, 2019; `STICKSLIP_DATA`, or ../shared/data,
has the record). The tables of docs/identification.md are made from the JSON, its figure is that of
the command.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import stickslip_ros as ss
from stickslip_ros.installed_packages import versions

RECORD = Path(
    os.environ.get("STICKSLIP_DATA", Path(__file__).parents[2] / "shared" / "data"),
    "emps/DATA_EMPS.mat",
)
COLUMNS = {"time": "t", "position": "qm", "force": "vir*gtau", "reference": "qg"}
HALF = 12.42
"""Where the record is divided, s."""
PUBLISHED = {
    "plant.mass": 95.1540,
    "plant.friction.viscous": 166.7061,
    "plant.friction.reverse.viscous": 240.4236,
    "plant.friction.static": 20.1440,
    "plant.friction.reverse.static": 20.6277,
    "force_error": 0.03058,
}
"""The published fit by direction; its force error without an artefact at the end."""
PUBLISHED_SYMMETRIC = {"position_error": 1.3752e-4, "closed_loop_force_error": 0.05848}
_MAIN = "from stickslip_ros.app.main import main; main()"
_KEPT = (
    "law",
    "parameters",
    "candidates",
    "force_error",
    "free_run_error",
    "position_error",
    "closed_loop_force_error",
    "force_delay",
    "servo",
)


def by_command(*options: str) -> dict[str, Any]:
    """Return what the command prints with --json, and the seconds that it took."""
    columns = ",".join(f"{name}={column}" for name, column in COLUMNS.items())
    begun = time.perf_counter()
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            _MAIN,
            "identify",
            RECORD.name,
            "--columns",
            columns,
            "--json",
            *options,
        ],
        check=True,
        capture_output=True,
        text=True,
        cwd=RECORD.parent,  # the figure has the name of the record
    )
    seconds = time.perf_counter() - begun
    found = json.loads(done.stdout)
    return {**{name: found[name] for name in _KEPT}, "seconds": round(seconds, 1)}


def halves() -> dict[str, dict[str, float | None]]:
    """Return what a fit to the first half of the record predicts of both halves."""
    model = ss.identify(RECORD, columns=COLUMNS, end=HALF)
    return {
        "fitted": model.check(RECORD, COLUMNS, end=HALF),
        "predicted": model.check(RECORD, COLUMNS, start=HALF),
    }


def study(*options: str) -> dict[str, Any]:
    """Return all that the page says of the axis; `options` are those of the chosen model."""
    return {
        "coulomb": by_command("--law", "coulomb"),
        "lugre": by_command("--law", "lugre"),
        "chosen": by_command(*options),
        "halves": halves(),
        "published": PUBLISHED,
        "published_symmetric": PUBLISHED_SYMMETRIC,
        "versions": versions(),
    }


def main() -> None:
    """Write the study as JSON, and the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--plot", type=Path)
    arguments = parser.parse_args()
    options = [] if arguments.plot is None else ["--plot", str(arguments.plot.absolute())]
    text = json.dumps(study(*options), indent=1) + "\n"
    if arguments.out is None:
        print(text, end="")
    else:
        arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
