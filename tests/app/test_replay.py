"""`stickslip replay`: a bag through the middleware, started as a user starts it."""

import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from stickslip_ros.messages.topics import CONTROL_FORCE, JOINT_STATES
from tests.app.conftest import Run
from tests.nodes.conftest import graph  # noqa: F401 - a fixture used here
from tests.nodes.graph import PATIENCE, Graph
from tests.nodes.runs import FORCES, STATES, messages_of, record_states

Start = Callable[..., subprocess.Popen[str]]


def test_it_says_what_it_waits_for_plays_to_the_end_and_is_done(
    start_stickslip: Start,
    graph: Graph,  # noqa: F811
    tmp_path: Path,
) -> None:
    record_states(tmp_path / "bag", 200)
    process = start_stickslip("replay", "bag", "--rate", "20", "--start", "0.5")
    assert process.stderr is not None
    offered = process.stderr.readline()
    assert f"bag: {FORCES}, {STATES}, loopback only" in offered
    assert "waiting until a node reads them" in offered
    assert "no node reads" in process.stderr.readline()
    forces, states = graph.listen(CONTROL_FORCE, raw=True), graph.listen(JOINT_STATES, raw=True)
    graph.wait_until(lambda: len(states) == len(forces) == 150, "all is heard")
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    heard = {FORCES: forces, STATES: states}
    for topic, messages in messages_of(tmp_path / "bag").items():
        assert heard[topic] == [message for _, message in messages[50:]]


def test_ctrl_c_ends_a_loop(
    start_stickslip: Start,
    graph: Graph,  # noqa: F811
    tmp_path: Path,
) -> None:
    record_states(tmp_path / "bag", 20)
    states = graph.listen(JOINT_STATES, raw=True)
    process = start_stickslip("replay", "bag", "--loop", "--topics", STATES)
    graph.wait_until(lambda: len(states) > 45, "the third pass")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, errors


def test_ctrl_c_ends_the_wait_for_a_reader(start_stickslip: Start, tmp_path: Path) -> None:
    record_states(tmp_path / "bag", 20)
    process = start_stickslip("replay", "bag")
    assert process.stderr is not None
    assert "waiting" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, errors


def test_a_call_whose_bag_is_taken_for_a_topic_says_where_it_stands(stickslip: Run) -> None:
    done = stickslip("replay", "--topics", "/x", "bag")
    assert done.returncode == 2
    assert "usage: stickslip replay BAG [OPTION ...]" in done.stderr
    assert "BAG" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("nosuch",), ("nosuch", "does not exist")),
        (("bag", "--rate", "0"), ("rate = 0.0", "above 0")),
        (("bag", "--start", "9"), ("start = 9.0 s", "0.01 s long")),
        (("bag", "--start", "1e300"), ("start = 1e+300", "at most 1e+10 s")),
        (("bag", "--wait-for", "1bad"), ("wait_for = ['1bad']", "names of nodes")),
        (("bag", "--topics", "/x", "/y"), ("topics = ['/x', '/y']", STATES, FORCES)),
        (("--topics", "/x", "--topics", "/y", "--", "bag"), ("topics = ['/x', '/y']",)),
    ],
)
def test_invalid_input_is_refused_in_one_line(
    stickslip: Run, tmp_path: Path, arguments: tuple[str, ...], named: tuple[str, ...]
) -> None:
    record_states(tmp_path / "bag", 2)
    done = stickslip("replay", *arguments)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    for text in named:
        assert text in line
