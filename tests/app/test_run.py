"""`stickslip run`, `set` and `replay`: through the middleware, as a user starts them."""

import json
import os
import signal
import time
from pathlib import Path

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from stickslip_ros.record.reader import Recording
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES
from tests.app.conftest import Run, Start, ended
from tests.nodes.graph import PATIENCE, Graph, states_of, wait_for
from tests.nodes.processes import wait_for_samples
from tests.nodes.runs import FORCES, STATES, messages_of, record_states


@pytest.mark.long
def test_samples_that_the_analyzer_has_not_taken_in_at_the_end_are_waited_for(
    start_stickslip: Start, graph: Graph, tmp_path: Path
) -> None:
    health = graph.health("/feed_drive/plant")
    in_real_time = ("--pace", "realtime", "--duration", "10")
    process = start_stickslip("run", "paper", *in_real_time, "--bag", "bag", "--json")
    wait_for_samples(process, tmp_path / "bag")
    (analyzer,) = (child for child in children(process.pid) if b"nodes.analyzer" in command(child))
    os.kill(analyzer, signal.SIGSTOP)
    graph.wait_until(lambda: states_of(health)[-3:] == 3 * ["inactive"], "the plant pauses")
    os.kill(analyzer, signal.SIGCONT)
    output, _ = ended(process, 0)
    result = json.loads(output)
    assert (result["samples"], result["report"]["complete"]) == (1001, True)


def test_a_plant_that_is_deactivated_pauses_the_run(start_stickslip: Start, graph: Graph) -> None:
    health = graph.health("/feed_drive/plant")

    def ask_for(transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        assert graph.call(ChangeState, "/feed_drive/plant/change_state", request).success

    process = start_stickslip("run", "paper", "--pace", "realtime", "--composed", "--json")
    graph.wait_until(lambda: "active" in states_of(health), "the plant is active")
    ask_for(Transition.TRANSITION_DEACTIVATE)
    told = len(states_of(health))
    graph.wait_until(lambda: len(states_of(health)) > told + 2, "it stays paused")
    assert states_of(health)[-1] == "inactive"
    assert process.poll() is None
    ask_for(Transition.TRANSITION_ACTIVATE)
    graph.wait_until(lambda: states_of(health)[-1] == "active", "it goes on")
    output, errors = ended(process, 130, signal.SIGINT)
    for told in ("the plant is paused", "the plant continues"):
        assert errors.count(told) == 1
    result = json.loads(output)
    assert (result["report"]["complete"], result["lost_samples"]) == (True, 0)


def test_no_node_outlives_a_run_that_is_killed(
    start_stickslip: Start, process_environment: dict[str, str], tmp_path: Path
) -> None:
    folder = tmp_path / "temporary"
    folder.mkdir()
    process_environment["TMPDIR"] = str(folder)
    process = start_stickslip("run", "feed_drive", "--bag", "bag")
    wait_for_samples(process, tmp_path / "bag")
    wait_for(lambda: not any(folder.iterdir()), "the nodes have read their parameters")
    nodes = children(process.pid)
    assert len(nodes) == 3
    process.kill()
    process.wait()
    wait_for(lambda: not any(is_running(node) for node in nodes), "the nodes end")
    assert list(folder.iterdir()) == []
    assert is_complete(tmp_path / "bag")


def is_complete(bag: Path) -> bool:
    with Recording(bag) as recording:
        return recording.complete


def command(pid: int) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()


def is_running(pid: int) -> bool:
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def children(pid: int) -> list[int]:
    return [
        int(child)
        for task in Path(f"/proc/{pid}/task").iterdir()
        for child in (task / "children").read_text().split()
    ]


def test_parameters_of_running_nodes_are_set_or_refused(
    stickslip: Run, start_stickslip: Start, tmp_path: Path
) -> None:
    run = start_stickslip("run", "paper", "--composed", "--pace", "realtime", "--bag", "bag")
    deadline = time.monotonic() + PATIENCE
    while True:
        done = stickslip("set", "plant.belt_speed=0.3", "washout_controller.linear_gain=-0.5")
        if done.returncode == 0 or time.monotonic() > deadline:
            break
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "/feed_drive/plant: belt_speed = 0.3 m/s",
        "/feed_drive/washout_controller: linear_gain = -0.5 N s/m",
    ]

    refused = stickslip("set", "plant.belt_speed=0.2", "plant.friction.static=0.1")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "/feed_drive/plant: friction.minimum = 0.25 must not exceed" in refused.stderr

    idle = stickslip("set", "plant.friction.viscous=0.5")
    assert (idle.returncode, idle.stdout) == (0, "/feed_drive/plant: friction.viscous = 0.5 s/m\n")
    assert "friction.viscous is not used by the law stribeck; laws that use it: " in idle.stderr

    elsewhere = stickslip("set", "--namespace", "other", "plant.belt_speed=0.2")
    assert (elsewhere.returncode, elsewhere.stdout) == (1, "")
    (line,) = elsewhere.stderr.splitlines()
    assert "no node /other/plant is running; running: /feed_drive/plant" in line
    assert "`stickslip run` starts the nodes, --namespace names another namespace" in line

    run.send_signal(signal.SIGINT)
    run.communicate(timeout=PATIENCE)
    with Recording(tmp_path / "bag") as recording:
        speeds = set(recording.joint_states.belt_velocity)
    assert speeds <= {0.4, 0.3}
    assert 0.3 in speeds


def test_it_says_what_it_waits_for_plays_to_the_end_and_is_done(
    start_stickslip: Start, graph: Graph, tmp_path: Path
) -> None:
    gone = {"stickslip_ros/plant": {"friction.law": '"rate_state"'}}  # no law of today
    record_states(tmp_path / "bag", 200, tables=gone)
    process = start_stickslip("replay", "bag", "--rate", "20", "--start", "0.5")
    offered = process.stderr.readline()
    assert f"bag: {FORCES}, {STATES}, loopback only" in offered
    assert "waiting until a node reads them" in offered
    assert "no node reads" in process.stderr.readline()
    forces, states = graph.listen(CONTROL_FORCE, raw=True), graph.listen(JOINT_STATES, raw=True)
    graph.wait_until(lambda: len(states) == len(forces) == 150, "all is heard")
    ended(process, 0)
    heard = {FORCES: forces, STATES: states}
    for topic, messages in messages_of(tmp_path / "bag").items():
        assert heard[topic] == [message for _, message in messages[50:]]


def test_ctrl_c_ends_the_wait_for_a_reader(start_stickslip: Start, tmp_path: Path) -> None:
    record_states(tmp_path / "bag", 20)
    process = start_stickslip("replay", "bag")
    assert "waiting" in process.stderr.readline()
    ended(process, 130, signal.SIGINT)
