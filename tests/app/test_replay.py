"""`stickslip replay`: a bag through the middleware, started as a user starts it."""

import signal
from pathlib import Path

from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES
from tests.app.conftest import Start, ended
from tests.nodes.graph import Graph
from tests.nodes.runs import FORCES, STATES, messages_of, record_states


def test_it_says_what_it_waits_for_plays_to_the_end_and_is_done(
    start_stickslip: Start,
    graph: Graph,
    tmp_path: Path,
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
