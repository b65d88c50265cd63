"""The replay node on the real middleware."""

from pathlib import Path

import pytest
from std_srvs.srv import Trigger

from stickslip_ros.nodes.replay import ReplayNode
from stickslip_ros.record.codec import unpack_header
from stickslip_ros.record.topics import CLOCK, CONTROL_FORCE, JOINT_STATES
from tests.nodes.graph import Graph
from tests.nodes.runs import FORCES, STATES, messages_of, record_states

SECOND = 1_000_000_000
FAST = 1e6


def stamps(messages: list[bytes]) -> list[int]:
    return [unpack_header(message) for message in messages]


@pytest.mark.parametrize("on_end", ["pause", "exit"])
def test_every_message_comes_as_it_was_recorded_and_then_the_node_pauses_or_ends(
    graph: Graph, tmp_path: Path, on_end: str
) -> None:
    bag = record_states(tmp_path / "bag", 300)
    states, forces = graph.listen(JOINT_STATES, raw=True), graph.listen(CONTROL_FORCE, raw=True)
    node = graph.add(ReplayNode, bag=bag, rate=FAST, on_end=on_end)
    graph.wait_until(lambda: len(states) == 300 and len(forces) == 300, "all is heard")
    graph.wait_until(lambda: not node.active, "the node pauses")
    assert node.stopped.done() == (on_end == "exit")
    for topic, heard in ((STATES, states), (FORCES, forces)):
        assert heard == [message for _, message in messages_of(Path(bag))[topic]]
    node.trigger_activate()
    graph.wait_until(lambda: len(states) == 600 and not node.active, "it plays again")
    assert states[300:] == states[:300]


def test_active_without_readers_it_waits_for_the_first_one(graph: Graph, tmp_path: Path) -> None:
    node = graph.add(ReplayNode, bag=record_states(tmp_path / "bag", 20), rate=FAST)
    graph.wait_until(lambda: "no node reads /test/joint_states" in node.diagnose()[1], "it waits")
    assert node.active
    assert node.diagnose()[2]["messages"] == 0
    states = graph.listen(JOINT_STATES, raw=True)
    graph.wait_until(lambda: len(states) == 20 and not node.active, "all is heard")


def test_paused_it_is_silent_until_it_is_resumed(graph: Graph, tmp_path: Path) -> None:
    def ask(service: str) -> Trigger.Response:
        return graph.call(Trigger, f"/test/replay/{service}", Trigger.Request())

    bag = record_states(tmp_path / "bag", 20_000, step=SECOND // 1000)
    heard = graph.listen(JOINT_STATES, raw=True)
    node = graph.add(ReplayNode, bag=bag)
    graph.wait_until(lambda: len(heard) > 3, "it plays")
    answer = ask("pause")
    assert answer.success
    assert answer.message.startswith("paused at ")
    assert ask("pause").message == answer.message
    sent = node.diagnose()[2]["messages"]
    graph.wait_until(lambda: 2 * len(heard) + 1 >= sent, "what was sent is heard")
    reached = len(heard)
    assert ask("resume").message.startswith("playing at ")
    assert ask("resume").success
    graph.wait_until(lambda: len(heard) > reached, "it goes on")
    assert stamps(heard) == [SECOND + n * SECOND // 1000 for n in range(len(heard))]
    graph.deactivate("replay")
    refused = ask("pause")
    assert not refused.success
    assert "not active" in refused.message


def test_part_and_topics_are_chosen_and_the_clock_shows_recorded_time(
    graph: Graph, tmp_path: Path
) -> None:
    states, forces = graph.listen(JOINT_STATES, raw=True), graph.listen(CONTROL_FORCE, raw=True)
    clock = graph.listen(CLOCK)
    parameters = {"start": 1.0, "duration": 0.5, "topics": [STATES], "clock": True, "rate": 4.0}
    node = graph.add(ReplayNode, bag=record_states(tmp_path / "bag", 300), **parameters)
    graph.wait_until(lambda: len(states) == 50 and not node.active, "the part")
    assert stamps(states) == [2 * SECOND + n * SECOND // 100 for n in range(50)]
    assert forces == []
    assert node.diagnose()[2]["position"] == pytest.approx(1.49)
    graph.wait_until(lambda: len(clock) == 50, "a time for each message")
    assert [m.clock.sec * SECOND + m.clock.nanosec for m in clock] == stamps(states)
