"""Run the benchmarks, each in its own process, and print one table: ours, the peer's, the ratio."""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks import dashboard
from benchmarks.slices import LACKING, Row, table
from stickslip_ros.installed_packages import versions

NAMES = (
    "start",
    "motion",
    "bifurcation",
    "sweep",
    "bags",
    "lockstep",
    "replay",
    "realtime",
    "dashboard",
)
TIMEOUT = 600.0


def main() -> int:
    """Run the named benchmarks, print their table or JSON; return the exit status.

    0: all done; 1: some failed; 77: none failed, but some need something that is not installed.
    """
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=__doc__,
        epilog="`python -m benchmarks.NAME --help` describes what a benchmark compares.",
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"benchmarks to run (default: {', '.join(NAMES)})"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write the JSON to this file")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(NAMES))
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}; available are {', '.join(NAMES)}")
    if arguments.out is not None and not arguments.out.parent.is_dir():
        parser.error(f"--out {arguments.out}: no directory {arguments.out.parent}")
    if arguments.out is not None and arguments.out.is_dir():
        parser.error(f"--out {arguments.out}: is a directory")
    report: dict[str, Any] = {
        "benchmarks": {},
        "failed": {},
        "skipped": [],
        "processors": os.cpu_count(),
        "load_average": os.getloadavg()[0],
        "versions": versions(),
    }
    names = list(dict.fromkeys(arguments.names or NAMES))
    if "dashboard" in names and (needed := dashboard.lacking()):
        print(f"dashboard is skipped: this needs {needed}", file=sys.stderr)
        names.remove("dashboard")
        report["skipped"].append("dashboard")
    for name in names:
        run(name, report)
    text = json.dumps(report, indent=2)
    if arguments.json:
        print(text)
    elif report["benchmarks"]:
        sections = {
            name: [Row(**row) for row in done["rows"]]
            for name, done in report["benchmarks"].items()
        }
        print(table(sections))
    for name, why in report["failed"].items():
        print(f"benchmarks.{name} failed: {why}", file=sys.stderr)
    for name in report["skipped"]:
        print(f"benchmarks.{name} skipped: a requirement is not installed", file=sys.stderr)
    if arguments.out is not None:
        arguments.out.write_text(text + "\n", encoding="utf-8")
    if report["failed"]:
        return 1
    return LACKING if report["skipped"] else 0


def run(name: str, report: dict[str, Any]) -> None:
    """Run one benchmark and add its rows, or its failure, or both, to the report."""
    print(f"{name} ...", end=" ", flush=True, file=sys.stderr)
    started = time.monotonic()
    command = [sys.executable, "-m", f"benchmarks.{name}", "--json"]
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        report["failed"][name] = f"not finished within {TIMEOUT:g} s"
        print("failed", file=sys.stderr)
        return
    seconds = round(time.monotonic() - started, 1)
    rows = json.loads(done.stdout)["rows"] if done.stdout else []
    if rows:
        report["benchmarks"][name] = {"seconds": seconds, "rows": rows}
    if done.returncode:
        failures = [f"{row['what']}: {row['failure']}" for row in rows if row["failure"]]
        report["failed"][name] = "; ".join(failures) or f"exit status {done.returncode}"
    print(f"{seconds:.0f} s{', failed' if done.returncode else ''}", file=sys.stderr)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
