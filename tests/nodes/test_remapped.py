"""Remapped topics: the nodes find each other and wait for each other as usual."""

from pathlib import Path

from std_srvs.srv import Trigger

from stickslip_ros.bags.reader import Recording
from stickslip_ros.messages.codec import pack_header, unpack_header
from stickslip_ros.messages.topics import JOINT_STATES, RECORDED
from stickslip_ros.nodes.plant import PlantNode
from tests.nodes.graph import Graph
from tests.nodes.runs import close_the_loop

REMAPPED = ("-r", "joint_states:=/x/y", "-r", "control_force:=/force", "-r", "recorded:=/held")


def test_the_loop_is_closed_and_recorded_under_other_names(domain: int, tmp_path: Path) -> None:
    graph = Graph(domain, *REMAPPED)
    close_the_loop(graph, tmp_path / "bag", flow_window=200, duration=10.0)
    graph.close()
    with Recording(tmp_path / "bag") as recording:
        names = [name for name, _, _ in recording.messages("/x/y", "/force")]
        assert recording.complete
    assert (names.count("/x/y"), names.count("/force")) == (1001, 1001)


def test_the_recorder_is_waited_for_under_another_name(domain: int) -> None:
    graph = Graph(domain, *REMAPPED)
    heard = graph.listen(JOINT_STATES, raw=True)
    recorder = graph.publisher(RECORDED)
    parameters = {"expects_control": False, "reply_timeout": 1e3, "wait_for": ["observer"]}
    graph.add(PlantNode, flow_window=200, **parameters)
    graph.wait_until(lambda: len(heard) >= 200, "the plant fills the window")
    graph.call(Trigger, "/test/plant/reset", Trigger.Request())  # it has had its chance to go on
    assert len(heard) == 200
    recorder.publish(pack_header(unpack_header(heard[-1])))
    graph.wait_until(lambda: len(heard) == 400, "the plant goes on")
    graph.close()
