"""Repeated external life cycle transitions while the loop runs."""

from pathlib import Path

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.parameter import Parameter

from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.topics import CONTROL_FORCE, DISTURBANCE_FORCE, JOINT_STATES, RECORDED
from tests.nodes.graph import Graph

ROUND = {
    Transition.TRANSITION_DEACTIVATE: "inactive",
    Transition.TRANSITION_CLEANUP: "unconfigured",
    Transition.TRANSITION_CONFIGURE: "inactive",
    Transition.TRANSITION_ACTIVATE: "active",
}
ENDS = {JOINT_STATES: (1, 2), CONTROL_FORCE: (1, 2), DISTURBANCE_FORCE: (0, 1), RECORDED: (1, 1)}
"""Publishers and subscriptions of each topic while plant, controller and analyzer are active."""


def state_of(graph: Graph, node: str) -> str:
    return graph.call(GetState, f"/test/{node}/get_state", GetState.Request()).current_state.label


def go_round(graph: Graph, node: str) -> None:
    """Deactivate, clean up, configure and activate a node, as `ros2 lifecycle` does."""
    for transition, state in ROUND.items():
        request = ChangeState.Request(transition=Transition(id=transition))
        graph.call(ChangeState, f"/test/{node}/change_state", request)
        while state_of(graph, node) != state:  # who is waited for may not be there yet
            graph.call(ChangeState, f"/test/{node}/change_state", request)


def ends(graph: Graph) -> dict[object, tuple[int, int]]:
    """Return how many publishers and subscriptions the topics have."""
    names = {topic: f"/test/{topic.name}" for topic in ENDS}
    return {
        topic: (graph.observer.count_publishers(name), graph.observer.count_subscribers(name))
        for topic, name in names.items()
    }


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
def test_repeated_life_cycles_leave_one_of_each_and_time_continues(
    graph: Graph, tmp_path: Path, pace: str
) -> None:
    graph.add(AnalyzerNode, bag=str(tmp_path / "bag"))
    graph.add(WashoutControllerNode, wait_for=["analyzer"])
    readers = ["analyzer", "washout_controller"]
    graph.add(PlantNode, pace=pace, wait_for=readers, reply_timeout=0.2)
    graph.wait_until(lambda: ends(graph) == ENDS, "the loop is closed")
    # They start by themselves: a round before that is over would meet it.
    for node in (*readers, "plant"):
        while state_of(graph, node) != "active":
            graph.run_for(0.05)
    for _ in range(2):
        for node in ("washout_controller", "plant"):
            go_round(graph, node)
            graph.wait_until(lambda: ends(graph) == ENDS, f"one of each again: {ends(graph)}")
    go_round(graph, "analyzer")
    graph.wait_until(lambda: ends(graph) == ENDS, f"one of each again: {ends(graph)}")

    with Recording(tmp_path / "bag") as recording:
        assert recording.complete
        states, forces = recording.joint_states.stamp, recording.control_forces.stamp
    assert len(forces) > 2
    assert (np.diff(states) > 0).all()
    assert (np.diff(forces) > 0).all()


def test_a_node_says_once_what_it_is_and_whom_it_waits_for(
    graph: Graph, capfd: pytest.CaptureFixture[str]
) -> None:
    said: list[str] = []

    def logged(text: str) -> int:
        lines = capfd.readouterr().err.splitlines()
        said.extend(line.partition("[test.plant]: ")[2] for line in lines if "[INFO]" in line)
        return said.count(text)

    plant = graph.add(PlantNode, wait_for=["observer", "nobody"], expects_control=False)
    graph.wait_until(lambda: logged("configured"), "it is configured")
    graph.run_for(0.3)  # it tries twenty times a second
    assert logged("waiting for observer, nobody: missing: nobody, observer") == 1
    graph.listen(JOINT_STATES, raw=True)
    plant.set_parameters([Parameter("wait_for", value=["observer"])])
    plant.set_parameters([Parameter("duration", value=1.0)])
    graph.wait_until(lambda: logged("paused"), "its second is over")
    assert said[-3:] == ["active", "finished: the last sample was reached", "paused"]
    assert len([line for line in said if line.startswith("waiting")]) == 1


def test_who_is_waited_for_listens_only_while_it_is_active(graph: Graph) -> None:
    """A plant must not take it for ready before it is."""
    names = ["washout_controller", "analyzer"]
    nodes = WashoutControllerNode, AnalyzerNode
    listeners = [graph.add(node, autostart=False) for node in nodes]
    for node in listeners:
        node.trigger_configure()
    plant = graph.add(PlantNode, wait_for=names, duration=1.0)

    def readers() -> int:
        return plant.count_subscribers(JOINT_STATES.name)

    assert readers() == 0
    for node in listeners:
        node.trigger_activate()
    graph.wait_until(lambda: listeners[0]._answered == 101, "each sample is answered")
    assert plant.diagnose()[2]["late_forces"] == 0
    assert readers() == 2
    for number, name in enumerate(names):
        graph.deactivate(name)
        graph.wait_until(lambda number=number: readers() == 1 - number, "it listens no more")
