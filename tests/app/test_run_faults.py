"""`stickslip run` and its nodes are killed, stopped, or lose their terminal."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.record.reader import Recording
from tests.app.conftest import REFERENCE, Run, Start, ended
from tests.app.test_run import children, command, is_complete, is_running
from tests.nodes.graph import PATIENCE, Graph, wait_for
from tests.nodes.processes import wait_for_samples
from tests.record.runs import full_disk

RUN = ("run", "feed_drive", "--bag", "bag", "-p", "analyzer.flush_period=0.2")


_MODULES = {"analyzer": "analyzer", "washout_controller": "controller", "plant": "plant"}
"""Module of each node of a run."""


def nodes_of(process: subprocess.Popen[str]) -> dict[str, int]:
    """Return the process of each node of a run."""
    return {
        node: child
        for child in children(process.pid)
        for node, module in _MODULES.items()
        if f"stickslip_ros.nodes.{module}".encode() in command(child)
    }


@pytest.mark.long
def test_the_bag_of_a_killed_analyzer_is_reported_and_can_be_repaired(
    start_stickslip: Start, stickslip: Run, tmp_path: Path
) -> None:
    process = start_stickslip(*RUN)
    wait_for_samples(process, tmp_path / "bag")
    os.kill(nodes_of(process)["analyzer"], signal.SIGKILL)
    _, errors = ended(process, 1)
    assert "the node analyzer died (killed by signal 9); the bag bag was not closed" in errors
    assert stickslip("repair", "bag", "sound").returncode == 0
    with Recording(tmp_path / "sound") as recording:
        assert recording.complete
        assert len(recording.joint_states.stamp) > 0


def test_a_plant_that_gives_up_is_reported_and_its_bag_is_closed(
    stickslip: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip_ros.motion.hybrid_motion._SPARE_STEPS", 10_000)
    stiff = ("--composed", "--bag", "bag", "-p", "plant.damping=1e12")
    done = stickslip("run", "paper", *stiff)
    assert done.returncode == 1
    assert "the plant could not continue: the motion is too stiff to be followed" in done.stderr
    assert done.stderr.endswith("the bag bag is closed\n")
    assert is_complete(tmp_path / "bag")


@pytest.mark.parametrize("flush_period", [0.01, 10.0])
def test_a_disk_that_becomes_full_is_the_reason_that_is_told_last(
    stickslip: Run, tmp_path: Path, flush_period: float
) -> None:
    """Also before a message is on it."""
    flush = ("-p", f"analyzer.flush_period={flush_period}")
    with full_disk(100_000):
        done = stickslip("run", "paper", "--composed", "--duration", "60", "--bag", "bag", *flush)
    assert done.returncode == 1
    why = f"the bag {tmp_path / 'bag'} can no longer be written ([Errno 27] File too large); "
    last = done.stderr.splitlines()[-1]
    if flush_period > 1.0:
        assert last == f"stickslip run: {why}it holds no message"
    else:
        assert last.endswith(f"not be written to its end: {why}what was written so far can be read")
        assert f"bag complete         no\nbag                  bag\n{why}" in done.stdout


@pytest.mark.parametrize(
    ("node", "number", "pace"),
    [
        ("washout_controller", signal.SIGKILL, "realtime"),
        pytest.param("plant", signal.SIGKILL, "lockstep", marks=pytest.mark.long),
    ],
)
def test_a_bag_is_closed_when_another_node_dies(
    start_stickslip: Start, tmp_path: Path, node: str, number: signal.Signals, pace: str
) -> None:
    process = start_stickslip(*RUN, "--pace", pace)
    wait_for_samples(process, tmp_path / "bag")
    os.kill(nodes_of(process)[node], number)
    _, errors = ended(process, 1)
    assert f"the node {node} died" in errors
    assert "the bag bag is closed" in errors
    assert is_complete(tmp_path / "bag")


IN_PROCESSES, COMPOSED = (), ("--composed",)
IGNORED = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


@pytest.mark.parametrize(
    ("number", "flags"),
    [
        (signal.SIGINT, COMPOSED),
        pytest.param(signal.SIGHUP, COMPOSED, marks=pytest.mark.long),
        pytest.param(signal.SIGINT, IN_PROCESSES, marks=pytest.mark.long),
        pytest.param(signal.SIGHUP, IN_PROCESSES, marks=pytest.mark.long),
    ],
)
def test_ctrl_c_or_a_terminal_that_is_closed_closes_the_bag(
    start_stickslip: Start, tmp_path: Path, number: signal.Signals, flags: tuple[str, ...]
) -> None:
    if number == signal.SIGHUP and IGNORED:
        pytest.skip("as under nohup")
    process = start_stickslip(*RUN, "--json", *flags)
    wait_for_samples(process, tmp_path / "bag")
    output, _ = ended(process, 130, number)
    assert json.loads(output)["report"]["complete"]


@pytest.mark.long
def test_nodes_that_are_stopped_are_killed_at_the_second_signal(
    start_stickslip: Start, tmp_path: Path
) -> None:
    process = start_stickslip(*RUN)
    wait_for_samples(process, tmp_path / "bag")
    nodes = nodes_of(process)
    for node in nodes.values():
        os.kill(node, signal.SIGSTOP)
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGTERM)  # two of a kind might count as one
    _, errors = ended(process, 1)
    for node, number in nodes.items():
        assert f"the node {node} did not end within" in errors
        assert not is_running(number)


@pytest.mark.long
def test_a_run_that_is_stopped_says_that_its_nodes_go_on(
    start_stickslip: Start, tmp_path: Path
) -> None:
    process = start_stickslip(*RUN)
    wait_for_samples(process, tmp_path / "bag")
    process.send_signal(signal.SIGTSTP)
    state = Path(f"/proc/{process.pid}/stat")
    wait_for(lambda: state.read_text().rpartition(")")[2].split()[0] == "T", "it is stopped")
    process.send_signal(signal.SIGCONT)
    _, errors = ended(process, 130, signal.SIGINT)
    assert "suspended: the nodes continue" in errors
    assert "interrupted: the bag bag is closed; the nodes have ended" in errors


def test_a_run_that_is_interrupted_early_says_that_nothing_was_recorded(
    start_stickslip: Start, tmp_path: Path
) -> None:
    alone = ("--composed", "--external-controller")
    process = start_stickslip("run", "feed_drive", *alone, "--bag", "bag")
    said = ""
    while "waiting for a controller" not in said:
        said = process.stderr.readline()
        assert said
    _, errors = ended(process, 130, signal.SIGINT)
    assert errors == "stickslip run: interrupted: nothing was recorded; the nodes have ended\n"
    assert not (tmp_path / "bag").exists()


@pytest.mark.process
def test_a_plant_of_others_that_has_its_name_ends_the_run_at_once(
    start_stickslip: Start, graph: Graph
) -> None:
    other = graph.add(PlantNode, autostart=False)
    other.trigger_configure()
    process = start_stickslip("run", "feed_drive", "--namespace", "/test")
    graph.wait_until(lambda: process.poll() is not None, "the run ends")
    _, errors = process.communicate()
    assert process.returncode == 1
    assert "plant could not start: another node has its name" in errors
    assert errors.endswith("; nothing was recorded\n")
    assert other.lifecycle_state == "inactive"


@pytest.mark.process
def test_what_a_plant_waits_for_in_vain_is_named(
    stickslip: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where somebody deactivates the controller before the plant is active."""
    monkeypatch.setattr("stickslip_ros.nodes.running.bringup._READY_TIMEOUT", 3.0)
    for transition in ("start", "stop"):
        name = f"stickslip_ros.nodes.controller.ControllerNode.{transition}"
        monkeypatch.setattr(name, lambda node: None)
    done = stickslip("run", "paper", "--composed", "--bag", "bag")
    assert done.returncode == 1
    assert "plant did not become ready within 3 s (missing: washout_controller)" in done.stderr


NEIGHBOUR = """
import rclpy
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node("neighbour")
publisher = node.create_publisher(JointState, "/feed_drive/elsewhere", 10)
subscription = node.create_subscription(JointState, "/feed_drive/joint_states", print, 10)
print("ready", flush=True)
rclpy.spin(node)
"""


def shared_memory_of(process: int) -> set[Path]:
    """Return the files in shared memory that are a process's alone."""
    mapped = Path(f"/proc/{process}/maps").read_text()
    segments = re.findall(r"/dev/shm/fastrtps_[0-9a-f]{16}\b", mapped)
    return {Path(segment + end) for segment in segments for end in ("", "_el")}


@pytest.mark.long
def test_what_killed_nodes_leave_in_shared_memory_harms_no_run(
    stickslip: Run, process_environment: dict[str, str]
) -> None:
    profile = ("FASTRTPS_DEFAULT_PROFILES_FILE", "SKIP_DEFAULT_XML_FILE")
    kept = {name: value for name, value in process_environment.items() if name not in profile}
    environment = {**kept, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    command = [sys.executable, "-c", NEIGHBOUR]
    left: set[Path] = set()
    try:
        for _ in range(3):
            with subprocess.Popen(
                command, env=environment, stdout=subprocess.PIPE, text=True
            ) as neighbour:
                assert neighbour.stdout.readline() == "ready\n"
                left |= shared_memory_of(neighbour.pid)
                neighbour.kill()
        assert any(file.exists() for file in left)
        outcome = stickslip.json("run", "paper", "--duration", "5")
        assert (outcome["samples"], outcome["lost_samples"], outcome["late_forces"]) == (501, 0, 0)
    finally:
        for file in left:
            file.unlink(missing_ok=True)


@pytest.mark.process
def test_a_reader_that_closes_the_pipe_is_no_failure() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    report = [sys.executable, "-m", "stickslip_ros.app.main", "report", REFERENCE]
    done = subprocess.run(report, stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.process
@pytest.mark.parametrize(
    "closed",
    [
        "--composed <&- >&- 2>&-",
        pytest.param("<&- >&- 2>&-", marks=pytest.mark.long),
        pytest.param("2>&-", marks=pytest.mark.long),
    ],
)
def test_a_run_does_without_standard_streams(
    process_environment: dict[str, str], tmp_path: Path, closed: str
) -> None:
    run = f"{sys.executable} -m stickslip_ros.app.main run paper --bag bag --duration 1 --json"
    done = subprocess.run(
        f"{run} {closed}",
        shell=True,
        cwd=tmp_path,
        env=process_environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    if ">&-" not in closed.split():
        assert json.loads(done.stdout)["samples"] == 101
    assert is_complete(tmp_path / "bag")
