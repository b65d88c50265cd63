"""How long does a command take to start?

Processor time of commands that compute nothing or little, beside that of `python -c pass` in the
same environment: what is left is the cost of importing. Then the wall time of one second of
lockstep through `stickslip run`, from the command to its table: most of it is starting and ending.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from benchmarks.slices import Row, by_turns, compare_times, show

ROUNDS, RUN_ROUNDS = 11, 5
PEER = "python -c pass"
STICKSLIP = ("-m", "stickslip_ros.app.main")
REFERENCE = str(Path(__file__).parents[1] / "bags/reference")

SHORT = {
    "import stickslip_ros": ("-c", "import stickslip_ros"),
    "stickslip --help": (*STICKSLIP, "--help"),
    "stickslip --version": (*STICKSLIP, "--version"),
    "stickslip run --help": (*STICKSLIP, "run", "--help"),
    "stickslip simulate, 1 s": (*STICKSLIP, "simulate", "paper", "--duration", "1"),
    "stickslip report": (*STICKSLIP, "report", REFERENCE),
}
RUN = (*STICKSLIP, "run", "feed_drive", "--pace", "lockstep", "--duration", "1", "--json")


def start(arguments: tuple[str, ...], folder: str) -> tuple[float, float]:
    """Run Python with these arguments to its end; return its processor and wall time, s."""
    started = time.perf_counter()
    # What ROS keeps for its children would spare them a part of their own start.
    environment = {k: v for k, v in os.environ.items() if not k.startswith("_ROS_WHEELS")}
    process = subprocess.Popen(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"{' '.join(arguments)}: exit status {process.returncode}")
    return usage.ru_utime + usage.ru_stime, time.perf_counter() - started


def processor_time(arguments: tuple[str, ...], folder: str) -> float:
    return start(arguments, folder)[0]


def wall_time(arguments: tuple[str, ...], folder: str) -> float:
    return start(arguments, folder)[1]


def measure() -> list[Row]:
    with TemporaryDirectory() as folder:
        bare: Callable[[], float] = partial(processor_time, ("-c", "pass"), folder)
        slices = [partial(processor_time, arguments, folder) for arguments in SHORT.values()]
        peer, *times = by_turns(ROUNDS, bare, *slices)
        rows = [
            compare_times(f"{name}, processor time", own, PEER, peer)
            for name, own in zip(SHORT, times, strict=True)
        ]
        runs = {"processes": RUN, "composed": (*RUN, "--composed")}
        walls = by_turns(RUN_ROUNDS, *(partial(wall_time, run, folder) for run in runs.values()))
        rows += [
            Row(f"stickslip run, 1 s in lockstep, {how}", "s", median(own))
            for how, own in zip(runs, walls, strict=True)
        ]
    return rows


if __name__ == "__main__":
    show(__doc__, measure)
