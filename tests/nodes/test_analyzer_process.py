"""The analyzer as a process that is stopped, killed or ended while it records what a test sends."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sensor_msgs.msg import JointState

from stickslip_ros.bags.reader import Recording
from stickslip_ros.bags.report import report_of_bag
from stickslip_ros.errors import BagError
from stickslip_ros.messages.codec import pack_joint_state
from stickslip_ros.messages.topics import JOINT_STATES
from stickslip_ros.nodes.base.ros_topics import qos_profile
from tests.nodes.graph import PATIENCE, Graph

PERIOD = 1_000_000


class Recorded:
    """Joint states that the test publishes and the analyzer records."""

    def __init__(
        self, graph: Graph, bag: Path, analyzer: subprocess.Popen[str], depth: int
    ) -> None:
        self.analyzer = analyzer
        self.sent: list[bytes] = []
        self._graph = graph
        self._bag = bag
        self._publisher = graph.observer.create_publisher(
            JointState, f"/test/{JOINT_STATES.name}", qos_profile(JOINT_STATES, depth)
        )
        graph.wait_until(lambda: self._publisher.get_subscription_count() == 1, "it listens")

    def send(self, count: int) -> None:
        """Publish so many further samples, as fast as that goes."""
        for number in range(len(self.sent), len(self.sent) + count):
            stamp = 1_000_000_000 + number * PERIOD
            self.sent.append(pack_joint_state(stamp, (number, 0.0), (1.0, 1.0), (0.0, 0.0)))
            self._publisher.publish(self.sent[-1])

    def in_bag(self) -> list[bytes]:
        """Return what can be read from the bag by now."""
        try:
            with Recording(self._bag) as recording:
                return [data for _, _, data in recording.messages(f"/test/{JOINT_STATES.name}")]
        except BagError:
            return []

    def wait_for_last(self) -> None:
        """Wait until the last message that was sent can be read from the bag."""
        self._graph.wait_until(lambda: self.in_bag()[-1:] == self.sent[-1:], "it is recorded")

    def finish(self, number: signal.Signals) -> dict[str, object]:
        """End the analyzer by a signal; return the report that it logs."""
        self.analyzer.send_signal(number)
        _, errors = self.analyzer.communicate(timeout=PATIENCE)
        assert self.analyzer.returncode == 0, errors
        (report,) = [line for line in errors.splitlines() if "report: " in line]
        return json.loads(report.partition("report: ")[2])


@pytest.fixture
def recorded(
    graph: Graph, process_environment: dict[str, str], tmp_path: Path
) -> Iterator[Callable[..., Recorded]]:
    processes: list[subprocess.Popen[str]] = []

    def start(depth: int, **parameters: object) -> Recorded:
        command = [sys.executable, "-m", "stickslip_ros.nodes.analyzer", "--ros-args"]
        command += ["-r", "__ns:=/test"]
        parameters = {"bag": tmp_path / "bag", "flush_period": 0.05} | parameters
        for name, value in parameters.items():
            command += ["-p", f"{name}:={value}"]
        process = subprocess.Popen(
            command, env=process_environment, stderr=subprocess.PIPE, text=True
        )
        processes.append(process)
        return Recorded(graph, tmp_path / "bag", process, depth)

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_killed_it_leaves_what_was_flushed(recorded: Callable[..., Recorded]) -> None:
    run = recorded(depth=10_000)
    run.send(1000)
    run.wait_for_last()
    run.send(1000)
    run.analyzer.kill()
    run.analyzer.wait()
    left = run.in_bag()
    assert len(left) >= 1000
    assert left == run.sent[: len(left)]


@pytest.mark.long
def test_what_is_lost_while_it_is_stopped_is_counted(
    recorded: Callable[..., Recorded], tmp_path: Path
) -> None:
    run = recorded(depth=10)
    run.send(1)
    run.wait_for_last()
    run.analyzer.send_signal(signal.SIGSTOP)
    run.send(5000)
    run.analyzer.send_signal(signal.SIGCONT)
    run.wait_for_last()
    report = run.finish(signal.SIGINT)
    left = run.in_bag()
    assert report["samples"] == len(left)
    assert report["lost_samples"] == len(run.sent) - len(left) > 0
    assert report_of_bag(tmp_path / "bag")["lost_samples"] == report["lost_samples"]


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_amid_flushes_and_splits_closes_the_bag(
    recorded: Callable[..., Recorded], tmp_path: Path, number: signal.Signals
) -> None:
    run = recorded(depth=10_000, flush_period=0.02, max_bag_size=1)
    run.send(500)
    run.finish(number)
    left = run.in_bag()
    assert left == run.sent[: len(left)]
    with Recording(tmp_path / "bag") as recording:
        assert recording.complete
