"""What do restarts cost? Each node of a loop ends many times and starts again, in both paces.

Every second time it is killed, otherwise SIGINT ends it. An observer, for which the plant waits,
hears the samples. It is checked that each bag can be read and has no gap between its samples, and
counted what had been heard and was not written when an analyzer was killed. Of the logs the lines
are shown, with the number of times that they came.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from rclpy.node import Node

from benchmarks.soak import Sendings
from stickslip_ros.nodes.base.network import domain_variables, own_domain
from stickslip_ros.nodes.base.process import loopback_session
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES, RECORDED
from stickslip_ros.scenarios.files import DEFAULT_NAMESPACE

OBSERVER = "outside"
NODES = "analyzer", "washout_controller", "plant"
PACES = "lockstep", "realtime"
FLUSHED = 1.5
"""Time, s, within which an analyzer has written what it has received: its `flush_period`, 1 s, and
some more."""
PERIOD = 1_000_000
"""Sample period, ns."""
PATIENCE = 60.0
"""Longest time, s, for the loop to go on."""


class Loop:
    """The three nodes in processes of their own, with an observer and a log of each."""

    def __init__(self, directory: Path, domain: int, observer: Node, pace: str) -> None:
        """Start them; the analyzer records to `directory`."""
        self.bag, self._environment = directory / "bag", os.environ | domain_variables(domain)
        self.samples = Sendings(observer, JOINT_STATES)
        others = Sendings(observer, CONTROL_FORCE), Sendings(observer, RECORDED)
        self._heard = dict(zip((self.samples, *others), (300, 300, 3), strict=True))
        self._settings: dict[str, dict[str, Any]] = {
            "analyzer": {"bag": self.bag, "bag_exists": "next", "wait_for": ["plant"]},
            "washout_controller": {"wait_for": ["plant"]},
            "plant": {"pace": pace, "rate": 1e9 / PERIOD, "reply_timeout": 1.0},
        }
        self._settings["plant"]["wait_for"] = [*NODES[:2], OBSERVER]
        self.logs = {node: (directory / f"{node}.log").open("w+") for node in NODES}
        self.processes = {node: self._started(node) for node in NODES}
        self.go_on()

    def restart(self, node: str, kill: bool) -> int:
        """End a node, start it again, and let the loop go on; return the stamp heard last, ns."""
        heard = self.end(node, kill)
        self.processes[node] = self._started(node)
        self.go_on()
        return heard

    def end(self, node: str, kill: bool) -> int:
        """Kill a node, or interrupt it; return the stamp heard last, ns."""
        self._take()
        heard = self.samples.stamps[-1]
        self.processes[node].send_signal(signal.SIGKILL if kill else signal.SIGINT)
        self.processes[node].wait(PATIENCE)
        self._take()
        return heard

    def go_on(self) -> None:
        """Wait until further samples, their answers and the progress of the analyzer are heard.

        An analyzer has written something by then.
        """
        self._take()
        reached = {heard: len(heard.stamps) + count for heard, count in self._heard.items()}
        begun = now = time.monotonic()
        last: float | None = None
        while last is None or now < last:
            now = time.monotonic()
            if last is None and all(len(h.stamps) >= count for h, count in reached.items()):
                last = now + FLUSHED
            if now > begun + PATIENCE:
                raise RuntimeError(f"the loop does not go on within {PATIENCE:g} s")
            time.sleep(0.02)
            self._take()

    def bags(self) -> Iterator[Path]:
        """Yield the bags in their order."""
        yield from sorted(self.bag.parent.glob("bag*"), key=lambda bag: (len(bag.name), bag.name))

    def _take(self) -> None:
        for heard in self._heard:
            heard.take()

    def _started(self, node: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"stickslip_ros.nodes.{node}", "--ros-args"]
        command += ["-r", f"__ns:={DEFAULT_NAMESPACE}"]
        for name, value in self._settings[node].items():
            command += ["-p", f"{name}:={value}"]
        return subprocess.Popen(command, env=self._environment, stderr=self.logs[node])


def restarts(node: str, pace: str, times: int, directory: Path) -> Iterator[str]:
    """Restart a node of a loop so many times; yield the result as lines of text.

    Raises RuntimeError if the loop does not go on, or if a bag lacks what it should hold.
    """
    with own_domain() as domain, loopback_session(domain, ["--ros-args"]) as spinner:
        observer = Node(OBSERVER, namespace=DEFAULT_NAMESPACE, context=spinner.executor.context)
        loop = Loop(directory, domain, observer, pace)
        heard = [loop.restart(node, kill=bool(number % 2)) for number in range(times)]
        for other in ("plant", "washout_controller", "analyzer"):
            heard.append(loop.end(other, kill=False))
        del heard[times:-1]
        observer.destroy_node()
    recorded, gaps = 0, 0
    unwritten = list[int]()
    for number, bag in enumerate(loop.bags()):
        with Recording(bag) as recording:
            stamps, missing = recording.joint_states.stamp, recording.missing
        recorded += len(stamps)
        gaps += int(np.sum(np.diff(stamps) != PERIOD))
        if node == "analyzer":
            unwritten.append(max(heard[number] - int(stamps[-1]), 0) // PERIOD)
        if missing and (node != "analyzer" or number % 2 == 0):
            raise RuntimeError(f"{bag.name} is not complete: {'; '.join(missing)}")
    if gaps != (times if node == "plant" else 0):  # a plant that is started again jumps
        raise RuntimeError(f"in the bags {gaps} samples do not follow the one before")
    bags = len(list(loop.bags()))
    yield f"{pace}, {node}: {times} restarts, {bags} bags, {recorded} samples"
    if node == "analyzer":
        killed, ended = max(unwritten[1::2]), max(unwritten[::2])
        yield f"  not written at its end: {killed} samples of a killed one, {ended} of another"
    for name, log in loop.logs.items():
        yield from (f"  {count:4d} {name}: {line}" for line, count in _lines(log).items())


def _lines(log: IO[str]) -> Counter[str]:
    """Return the lines of a log without times and numbers, each with its number."""
    log.seek(0)
    texts = (line.partition("]: ")[2] or line for line in log.read().splitlines())
    return Counter(re.sub(r"\d[\d.e+-]*", "#", text)[:110] for text in texts)


def main() -> None:
    """Restart the nodes in turn, and print the results."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--times", type=int, default=20, help="of each node (default: 20)")
    parser.add_argument("--node", choices=NODES, action="append", help="(default: each)")
    parser.add_argument("--pace", choices=PACES, action="append", help="(default: both)")
    chosen = parser.parse_args()
    for pace in chosen.pace or PACES:
        for node in chosen.node or NODES:
            with tempfile.TemporaryDirectory() as directory:
                print(*restarts(node, pace, chosen.times, Path(directory)), sep="\n", flush=True)


if __name__ == "__main__":
    main()
