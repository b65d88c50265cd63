"""The ROS node of the dashboard: what is known of a run by its data, and requests to it."""

from functools import partial

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterEvent, ParameterValue
from rclpy.parameter import Parameter

from stickslip_ros.app.dashboard import run_requests, run_state
from stickslip_ros.app.dashboard.listener import ListenerNode
from stickslip_ros.app.dashboard.run_requests import Answer
from stickslip_ros.app.dashboard.run_state import ABSENT, SILENT, Health, RunState
from stickslip_ros.app.dashboard.theory import Theory
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.controller import ControllerNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.topics import (
    AMPLITUDE,
    APPLIED_DISTURBANCE,
    DIAGNOSTICS,
    FREQUENCY,
    STICK_FRACTION,
)
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.scenarios.files import load_scenario
from tests.nodes.graph import Graph

pytestmark = pytest.mark.usefixtures("often_diagnosed")


class Shown:
    """Collects what an observer passes on."""

    def __init__(self) -> None:
        self.states: list[SampleColumns] = []
        self.forces: list[ForceColumns] = []

    def take(self, states: SampleColumns, forces: ForceColumns, _: ForceColumns) -> None:
        self.states.append(states)
        self.forces.append(forces)

    @property
    def stamps(self) -> np.ndarray:
        return np.concatenate([states.stamp for states in self.states])

    @property
    def position(self) -> np.ndarray:
        return np.concatenate([states.position for states in self.states])


@pytest.fixture
def shown() -> Shown:
    return Shown()


@pytest.fixture
def observer(graph: Graph, shown: Shown) -> ListenerNode:
    node = ListenerNode(RunState("/test"), shown.take, context=graph.context)
    graph.adopt(node)
    return node


def outcome(graph: Graph, answer: Answer) -> str:
    graph.wait_until(answer.done, "an answer")
    return answer.result()


def run_loop(graph: Graph, observer: ListenerNode, **values: object) -> PlantNode:
    """Let all three run, until the observer has heard of them all and knows their parameters."""
    graph.add(AnalyzerNode)
    graph.add(WashoutControllerNode)
    plant = graph.add(PlantNode, **{"pace": "realtime", "belt_speed": 0.2, **values})
    graph.wait_until(
        lambda: (
            len(observer.run.health) == 3
            and all(health.state == "active" for health in observer.run.health.values())
            and all(observer.run.parameters[node] for node in observer.run.health)
        ),
        "the observer knows all nodes",
    )
    return plant


def test_it_hears_states_forces_and_cycles(
    graph: Graph, observer: ListenerNode, shown: Shown
) -> None:
    assert {health.state for health in observer.run.health.values()} == {ABSENT}
    run_loop(graph, observer, pace="lockstep", rate=50.0, expects_control=False)
    graph.wait_until(lambda: observer.run.cycle_count > 3, "cycles")
    assert (np.diff(shown.stamps) > 0).all()
    assert len(shown.stamps) > 300
    assert max(len(forces.stamp) for forces in shown.forces) > 0
    assert {len(values) > 3 for values in observer.run.cycles.values()} == {True}
    assert observer.run.cycles[AMPLITUDE][-1] > 0.0
    assert 0.0 <= observer.run.cycles[STICK_FRACTION][-1] <= 1.0
    assert 0.1 < observer.run.cycles[FREQUENCY][-1] < 0.2
    assert int(observer.run.health["plant"].figures["samples"]) > 0
    for node in graph._nodes[2:]:  # not the observers
        node.trigger_shutdown()
    graph.wait_until(lambda: observer._ended, "the run has ended")
    graph.add(PlantNode)
    graph.wait_until(lambda: not observer.run.cycle_count, "the next run has no cycles yet")


def test_a_value_is_taken_or_refused_with_the_reason_of_the_node(
    graph: Graph, observer: ListenerNode
) -> None:
    plant = run_loop(graph, observer)
    assert observer.run.parameters["plant"]["belt_speed"] == 0.2
    assert not outcome(graph, observer.requests.set_parameter("plant.belt_speed", 0.3))
    graph.wait_until(lambda: observer.run.parameters["plant"]["belt_speed"] == 0.3, "the new value")
    set_parameter = observer.requests.set_parameter
    refusal = outcome(graph, set_parameter("washout_controller.corner_frequency", -1.0))
    assert "corner_frequency = -1.0 is invalid: must be a finite number above 0" in refusal
    assert observer.run.parameters["washout_controller"]["corner_frequency"] == 2.0
    assert "rate cannot be changed" in outcome(graph, set_parameter("plant.rate", 1.0))
    plant.set_parameters([Parameter("damping", value=0.5)])  # by others
    graph.wait_until(lambda: observer.run.parameters["plant"]["damping"] == 0.5, "the new value")
    for active, state in ((False, "inactive"), (True, "active")):
        assert not outcome(graph, observer.requests.set_active("washout_controller", active))
        graph.wait_until(
            lambda s=state: observer.run.health["washout_controller"].state == s, f"it is {state}"
        )
        # A request that is repeated, since its answer was lost, has been obeyed.
        assert not outcome(graph, observer.requests.set_active("washout_controller", active))
    assert [each.text for each in observer.run.events if "inactive" in each.text] == [
        "washout_controller inactive"
    ]


FOREIGN = (
    *(("plant", "mass", value) for value in ("abc", True, [1.0], -1.0, float("nan"), 1e300)),
    *(("plant", "friction.file", value) for value in ("/etc/passwd", 3)),
    *(("plant", name, "abc") for name in ("rate", "belt_speed", "reply_timeout", "pace")),
    *(("washout_controller", name, "abc") for name in ("start_after", "linear_gain")),
)
"""Values of parameters that no node of ours has."""


def test_a_value_that_a_parameter_cannot_have_is_not_known(
    graph: Graph, observer: ListenerNode
) -> None:
    publisher = observer.create_publisher(ParameterEvent, "/parameter_events", 100)
    graph.wait_until(publisher.get_subscription_count, "the observer listens")
    sound = load_scenario("feed_drive").as_dict()
    active = Health("active", heard_at=1e9)
    observer.run.health = dict.fromkeys(("analyzer", "plant", "washout_controller"), active)
    observer.run._answering_since = 0.0
    theory = Theory(observer.run)
    for node, name, value in FOREIGN:
        observer.run.parameters = observer.run.parameters | sound
        parameters = [Parameter(name, value=value).to_parameter_msg()]
        publisher.publish(ParameterEvent(node=f"/test/{node}", changed_parameters=parameters))
        graph.wait_until(
            lambda n=node, p=name: observer.run.parameters[n][p] is None, f"{name} {value}"
        )
        assert (observer.run.drive is None) == (node == "plant")
        theory.follow()
        assert observer.run.acts_in >= 0.0
        assert observer.run.waits_for_reply >= 0.0
    assert not observer.run.events


def test_a_single_value_is_not_all_that_is_known(graph: Graph, observer: ListenerNode) -> None:
    """And one of an unknown type is ignored."""
    publisher = observer.create_publisher(ParameterEvent, "/parameter_events", 10)
    graph.wait_until(publisher.get_subscription_count, "the observer listens")
    observer.run.parameters = observer.run.parameters | {"analyzer": {"window": 8}}
    strange = ParameterMessage(name="window", value=ParameterValue(type=99))
    duration, window = Parameter("duration", value=2.0), Parameter("window", value=9)
    for node, changed in (
        ("plant", duration.to_parameter_msg()),
        ("analyzer", strange),
        ("analyzer", window.to_parameter_msg()),
    ):
        publisher.publish(ParameterEvent(node=f"/test/{node}", changed_parameters=[changed]))
    graph.wait_until(lambda: observer.run.parameters["analyzer"].get("window") == 9, "the change")
    assert observer.run.parameters["plant"] == {}


def test_the_controller_is_the_one_that_is_heard(graph: Graph, observer: ListenerNode) -> None:
    assert observer.run.controller == "washout_controller"
    assert set(observer.run.health) == {"analyzer", "plant"}
    node = graph.add(partial(ControllerNode, "velocity_feedback"), velocity_gain=-0.25)
    graph.wait_until(lambda: observer.run.law == "velocity_feedback", "the controller")
    assert observer.run.controller == node.get_name() == "velocity_feedback_controller"
    graph.wait_until(lambda: observer.run.parameters[observer.run.controller], "its parameters")
    assert observer.run.parameters[observer.run.controller]["velocity_gain"] == -0.25
    assert set(observer.run.health) == {"analyzer", "plant", "velocity_feedback_controller"}


def test_reset_puts_the_motion_back(graph: Graph, observer: ListenerNode, shown: Shown) -> None:
    run_loop(graph, observer, expects_control=False, **{"initial.position": 0.5})
    graph.wait_until(lambda: shown.states and abs(shown.position[-1] - 0.5) > 0.05, "it moves")
    before = len(shown.position)
    assert not outcome(graph, observer.requests.reset())
    graph.wait_until(lambda: 0.5 in shown.position[before:], "the initial position again")


@pytest.mark.parametrize("pace", ["realtime", "lockstep"])
def test_a_tap_lasts_for_its_simulated_time_and_ends(
    graph: Graph, observer: ListenerNode, pace: str
) -> None:
    applied = graph.listen(APPLIED_DISTURBANCE)
    run_loop(graph, observer, pace=pace, rate=1000.0)
    assert not outcome(graph, observer.impulse.apply(0.05, 0.2))
    graph.wait_until(
        lambda: [m.wrench.force.x for m in applied][-2:] == [0.05, 0.0], "the force comes and goes"
    )
    begin, end = (m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in applied[-2:])
    assert end - begin > 0.199


def test_an_impossible_tap_is_refused(
    graph: Graph, observer: ListenerNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    for force, duration in ((float("nan"), 1.0), (float("inf"), 1.0), (1.0, 0.0), (1.0, 1e300)):
        refusal = outcome(graph, observer.impulse.apply(force, duration))
        assert refusal.startswith("an impulse needs a finite force and a duration above 0, at most")
    refusal = outcome(graph, observer.impulse.apply(1.0, 0.1))
    assert refusal == "no node subscribes to /test/disturbance_force"
    monkeypatch.setattr(run_requests, "_ANSWER_TIMEOUT", 0.3)
    assert outcome(graph, observer.requests.reset()) == "plant does not answer"


def test_the_health_of_a_limited_number_of_nodes_is_kept(
    graph: Graph, observer: ListenerNode
) -> None:
    publisher = graph.observer.create_publisher(DiagnosticArray, DIAGNOSTICS.name, 100)
    statuses = [DiagnosticStatus(name=f"/test/<b>{number}</b>") for number in range(200)]
    message = DiagnosticArray(status=[*statuses, DiagnosticStatus(name="/test/plant")])
    message.status[-1].message = "the last of them"

    def heard() -> bool:
        publisher.publish(message)
        return observer.run.health["plant"].message == "the last of them"

    graph.wait_until(heard, "the diagnostics")
    assert len(observer.run.health) == 50


def test_a_push_ends_with_the_observer(graph: Graph, observer: ListenerNode) -> None:
    applied = graph.listen(APPLIED_DISTURBANCE)
    run_loop(graph, observer)
    assert not outcome(graph, observer.impulse.apply(0.05, 1e6))
    graph.wait_until(lambda: [m.wrench.force.x for m in applied][-1:] == [0.05], "the force")
    observer.close()
    graph.wait_until(lambda: applied[-1].wrench.force.x == 0.0, "no force")


def test_a_node_that_falls_silent_and_comes_back_is_shown_as_that(
    graph: Graph, observer: ListenerNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_state, "SILENCE", 1.0)
    plant = graph.add(PlantNode, pace="realtime", expects_control=False)
    graph.wait_until(lambda: observer.run.health["plant"].state == "active", "the plant")
    graph.executor.remove_node(plant)
    graph.wait_until(lambda: observer.run.health["plant"].state == SILENT, "silence")
    graph.executor.add_node(plant)
    graph.wait_until(lambda: observer.run.health["plant"].state == "active", "the plant again")
    events = [each.text for each in observer.run.events]
    assert events.index("plant silent") < events.index("plant is back, active")
    observer.run.health = {"plant": Health("inactive", 2, "the motion diverges", heard_at=0.1)}
    observer.run.mark_silent()
    assert observer.run.health["plant"].message == "the motion diverges"


CONTROLLER = "washout_controller"


def status(**figures: str) -> DiagnosticStatus:
    """Return the diagnostics of a node, with a level that ROS does not have."""
    values = [KeyValue(key=key, value=value) for key, value in figures.items()]
    return DiagnosticStatus(values=values, level=b"\xff")


def test_any_number_in_diagnostics_is_accepted() -> None:
    run = RunState("/test")
    run.parameters = {**run.parameters, "plant": {"rate": 1e-6}}
    for number in ("٣", "²", "abc", "nan", "-1", "9" * 400, "9" * 5000, ""):
        for node in ("plant", CONTROLLER, "plant", CONTROLLER):
            run.take_status(node, status(answered=number, samples=number, late_forces=number))
        assert run.acts_in == 0.0
        assert run.health["plant"].figures["samples"] == number


def test_a_controller_that_is_switched_leaves_a_mark_and_may_have_other_parameters() -> None:
    run = RunState("/test")
    assert run.take_status(CONTROLLER, status(state="inactive"))  # heard for the first time
    assert not run.take_status(CONTROLLER, status(state="inactive"))
    assert not run.control_on
    assert run.take_status(CONTROLLER, status(state="active"))
    assert run.control_on
    assert run.take_status(CONTROLLER, status(state="inactive"))
    assert [event.mark for event in run.events] == ["", "control on", "control off"]


def test_a_counter_that_starts_again_is_that_of_another_node() -> None:
    run = RunState("/test")
    run.take_status("plant", status(state="active", samples="150"))
    assert not run.take_status("plant", status(state="active", samples="160"))
    assert run.take_status("plant", status(state="active", samples="3"))
    assert [event.text for event in run.events] == ["plant active", "plant restarted"]
