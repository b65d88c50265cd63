"""Nodes that were started one by one are killed, stopped, continued and restarted.

`python -m benchmarks.restarts` restarts each node.
"""

import signal
import subprocess
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.restarts import restarts
from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError
from stickslip_ros.record.bag_files import runs_of
from stickslip_ros.record.codec import unpack_header
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES, RECORDED, Topic
from tests.nodes.graph import PATIENCE, Graph, wait_for
from tests.nodes.processes import Processes
from tests.nodes.samples import Samples

NODES = ("analyzer", "washout_controller", "plant")
PERIOD = 1_000_000
"""Of a sample, ns."""


class Trio:
    """The three nodes as processes at 1 kHz, the plant waiting for the others."""

    def __init__(self, graph: Graph, processes: Processes, folder: Path) -> None:
        self.plant: dict[str, object] = {
            "pace": "lockstep",
            "reply_timeout": PATIENCE,
            "wait_for": "[washout_controller, analyzer]",
        }
        self.bags: list[Path] = []
        self.graph = graph
        self._processes = processes
        self._folder = folder
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, node: str) -> None:
        parameters: dict[str, object] = {}
        if node == "plant":
            parameters = {"rate": 1000, **self.plant}
        elif node == "analyzer":
            self.bags.append(self._folder / f"bag_{len(self.bags)}")
            parameters = {"bag": self.bags[-1], "flush_period": 0.1}
        self._running[node] = self._processes.node(node, **parameters)

    def send(self, node: str, number: signal.Signals) -> None:
        self._running[node].send_signal(number)
        if number == signal.SIGKILL:
            self._running[node].wait()

    def stop(self, nodes: Sequence[str], seconds: float) -> None:
        """Stop nodes for so long, and wait until the loop is closed again."""
        for node in nodes:
            self.send(node, signal.SIGSTOP)
        self.graph.run_for(seconds)
        for node in nodes:
            self.send(node, signal.SIGCONT)
        self.wait_for_closed_loop()

    def end(self) -> None:
        """End the nodes as Ctrl-C does, the analyzer last."""
        for node in reversed(NODES):
            self.send(node, signal.SIGINT)
            assert self._running[node].wait(PATIENCE) == 0

    def wait_for_closed_loop(self) -> None:
        """Wait until samples that come from now on are answered and recorded."""
        topics = (JOINT_STATES, CONTROL_FORCE, RECORDED)
        with ExitStack() as listening:
            states, forces, recorded = (listening.enter_context(self._heard(t)) for t in topics)
            self.graph.wait_until(
                lambda: len(states & forces) > 20 and len(states & recorded) > 1,
                "the loop is closed",
            )

    @contextmanager
    def _heard(self, topic: Topic) -> Generator[set[int]]:
        """Collect the stamps of a topic; a reader made now hears nothing that was sent before."""
        stamps: set[int] = set()

        def hear(message: Any) -> None:
            stamps.add(unpack_header(message))

        reader = self.graph.subscribe(topic, hear)
        yield stamps
        self.graph.observer.destroy_subscription(reader)


@pytest.fixture
def trio(graph: Graph, processes: Processes, tmp_path: Path) -> Trio:
    return Trio(graph, processes, tmp_path)


def stamps(bag: Path, topic: str = "joint_states") -> IntArray:
    """Return the stamps in a bag, none if it was killed before it had the topic."""
    try:
        with Recording(bag, "/test") as recording:
            assert not [text for text in recording.missing if "could not be read" in text]
            states, forces = recording.joint_states, recording.control_forces
    except BagError:
        return np.empty(0, dtype=np.int64)
    return states.stamp if topic == "joint_states" else forces.stamp


def gaps(stamp: IntArray) -> int:
    """Return how many samples are missing, from segment to segment, by the stamps alone."""
    steps = np.diff(stamp)
    return int((steps[(steps > 0) & (steps % PERIOD == 0)] // PERIOD - 1).sum())


@pytest.mark.long
def test_a_killed_node_is_replaced(trio: Trio, processes: Processes) -> None:
    trio.plant["reply_timeout"] = 1.0
    for node in NODES:
        trio.start(node)
    trio.wait_for_closed_loop()

    trio.send("washout_controller", signal.SIGKILL)
    Samples(trio.graph).wait_for(100)
    trio.start("washout_controller")
    trio.wait_for_closed_loop()

    trio.send("plant", signal.SIGKILL)
    trio.start("plant")
    trio.wait_for_closed_loop()

    killed = trio.bags[0]
    wait_for(lambda: (np.diff(stamps(killed)) < 0).any(), "the new segment is on the disk")
    trio.send("analyzer", signal.SIGKILL)
    left = {file: file.read_bytes() for file in killed.iterdir()}
    assert processes.node("analyzer", bag=killed).wait(PATIENCE) == 2
    assert {file: file.read_bytes() for file in killed.iterdir()} == left
    trio.start("analyzer")
    trio.wait_for_closed_loop()
    trio.end()

    assert report_of_recording(trio.bags[1])["complete"]
    for bag, segments in zip(trio.bags, (2, 1), strict=True):
        stamp = stamps(bag)
        assert np.count_nonzero(np.diff(stamp) < 0) == segments - 1
        assert gaps(stamp) == report_of_recording(bag)["lost_samples"]


@pytest.mark.long
@pytest.mark.parametrize("order", [NODES[::-1], (NODES[1], NODES[2], NODES[0])])
def test_every_order_of_start_loses_nothing(trio: Trio, order: tuple[str, ...]) -> None:
    """The other tests start the analyzer first and the plant last."""
    for node in order:
        trio.start(node)
    trio.wait_for_closed_loop()
    trio.end()
    stamp = stamps(trio.bags[0])
    assert stamp.tolist() == [1_000_000_000 + n * PERIOD for n in range(len(stamp))]


@pytest.mark.long
def test_in_lockstep_a_stop_costs_nothing(trio: Trio) -> None:
    for node in NODES:
        trio.start(node)
    trio.wait_for_closed_loop()
    for stopped in ([NODES[0]], [NODES[1]], [NODES[2]], NODES):
        trio.stop(stopped, 1.0)
    trio.end()
    stamp = stamps(trio.bags[0])
    assert stamp.tolist() == [1_000_000_000 + n * PERIOD for n in range(len(stamp))]
    # The controller does not wait for the analyzer, which may miss the first forces.
    forces = stamps(trio.bags[0], "control_force")
    assert set(np.diff(forces)) <= {PERIOD}


@pytest.mark.long
def test_in_real_time_what_a_stop_costs_is_counted(trio: Trio) -> None:
    trio.plant["pace"] = "realtime"
    for node in NODES:
        trio.start(node)
    trio.wait_for_closed_loop()
    trio.stop(["analyzer"], 6.0)  # longer than the plant's history
    for node in ("washout_controller", "plant"):
        trio.stop([node], 1.0)
    trio.end()
    stamp = stamps(trio.bags[0])
    steps = np.diff(stamp)
    assert (steps > 0).all()
    assert (steps % PERIOD == 0).all()
    assert report_of_recording(trio.bags[0])["lost_samples"] == gaps(stamp)


@pytest.mark.long
@pytest.mark.process
def test_bags_of_an_analyzer_that_is_restarted_are_sound_and_one_run(tmp_path: Path) -> None:
    first, *lines = restarts("analyzer", "realtime", 2, tmp_path)
    assert "2 restarts, 3 bags" in first
    assert any("plant: active" in line for line in lines)
    bag, *others = (tmp_path / name for name in ("bag", "bag_2", "bag_3"))
    runs = runs_of([bag, *others])
    assert list(runs) == [bag]
    assert list(runs[bag]) == others
    assert all(gap > 0.0 for gap in runs[bag].values())
    stamps: list[int] = []
    for path in (bag, *others):
        with Recording(path) as recording:
            stamps += recording.joint_states.stamp.tolist()
    report = report_of_recording(bag, continued=runs[bag])
    assert report["samples"] == len(stamps)
    periods = (stamps[-1] - stamps[0]) / 1e6
    assert report["lost_samples"] == round(periods) + 1 - len(stamps)
