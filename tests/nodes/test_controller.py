"""The controller node of any law, and references, on the real middleware."""

from functools import partial
from math import nan
from pathlib import Path
from typing import Any

import pytest
from rclpy.duration import Duration
from rclpy.parameter import Parameter

from stickslip_ros.model.control import Pid
from stickslip_ros.model.control.base import State
from stickslip_ros.model.signals import ramp
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.controller import ControllerNode
from stickslip_ros.record.codec import (
    HELD,
    joint_state_packer,
    pack_joint_state,
    pack_reference,
    unpack_wrench,
)
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES, REFERENCE
from stickslip_ros.samples import Reference, Sample
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS
from tests.nodes.graph import PATIENCE, Graph

SECOND = 1_000_000_000


servo = partial(ControllerNode, "pid")
SPRING = {"position_gain": 10.0, "velocity_gain": 1.0, "integral_gain": 0.0}
"""A spring to the reference, and a damper."""


class Loop:
    """Sends joint states to a controller and hears its forces and its reference."""

    def __init__(self, graph: Graph, node: partial[ControllerNode], **parameters: object) -> None:
        self.graph = graph
        self.forces = graph.listen(CONTROL_FORCE, raw=True)
        self.references = graph.listen(REFERENCE, raw=True)
        self.controller = graph.add_active(node, **parameters)
        self.states, self.given = graph.publisher(JOINT_STATES, 1), graph.publisher(REFERENCE)

    def force(self, stamp: int, position: float = 0.0, velocity: float = 0.0) -> float:
        """Send a state and return the force of the answer."""
        heard = len(self.forces)
        self.states.publish(pack_joint_state(stamp, (position, 0.0), (velocity, 0.0), (0.0, 0.0)))
        self.graph.wait_until(lambda: len(self.forces) > heard, f"answer to {stamp}")
        answered, force = unpack_wrench(self.forces[-1])
        assert answered == stamp
        return force


def test_a_law_has_a_node_of_its_name_and_its_constants_as_parameters(graph: Graph) -> None:
    loop = Loop(graph, partial(ControllerNode, "velocity_feedback"), velocity_gain=-3.0)
    assert loop.controller.get_fully_qualified_name() == "/test/velocity_feedback_controller"
    assert loop.controller.get_parameter("law").value == "velocity_feedback"
    assert loop.force(SECOND, position=5.0, velocity=0.5) == -1.5
    (result,) = loop.controller.set_parameters([Parameter("position_gain", value=2)])
    assert result.successful
    assert loop.force(2 * SECOND, position=5.0, velocity=0.5) == 8.5
    (result,) = loop.controller.set_parameters([Parameter("law", value="washout")])
    assert not result.successful
    assert "law = 'washout'" in result.reason


def test_what_is_no_later_finite_state_is_dropped_and_the_filter_goes_on(graph: Graph) -> None:
    loop = Loop(graph, partial(ControllerNode, "washout"))
    law = CONTROLLER_PARAMETERS["washout"].as_controller()

    def check(stamp: int, velocity: float) -> None:
        sample = Sample(stamp, 0.0, velocity, 0.0, 0.0, 0.0)
        assert loop.force(stamp, velocity=velocity) == law.answer(sample)

    for number, velocity in enumerate((0.1, 0.3, -0.2)):
        check(SECOND + number * SECOND // 100, velocity)
    zero = (0.0, 0.0)
    for message, told in (
        (pack_joint_state(2 * SECOND, zero, (nan, 0.4), zero), "velocity nan"),
        (pack_joint_state(2 * SECOND, (float("inf"), 0.0), zero, zero), "position inf"),
        (b"\x00\x01\x00\x00 nothing", "ends after"),
        (pack_joint_state(SECOND + SECOND // 100, zero, (0.3, 0.4), zero), "not later than the"),
    ):
        loop.states.publish(message)
        graph.wait_until(lambda told=told: told in loop.controller.diagnose()[1], "it is dropped")
    check(2 * SECOND, 0.4)
    assert len(loop.forces) == 4
    assert loop.force(SECOND, velocity=0.1) == 0.0  # a plant that was started again


def test_a_state_at_which_the_force_is_held_is_not_answered(graph: Graph) -> None:
    loop = Loop(graph, partial(ControllerNode, "washout"))
    law = CONTROLLER_PARAMETERS["washout"].as_controller()
    held = joint_state_packer("slide", "belt", frame=HELD)
    for number in range(3):
        stamp, speeds = SECOND + number * SECOND // 100, (0.1 * number, 0.0)
        sample = Sample(stamp, 0.0, speeds[0], 0.0, 0.0, 0.0)
        assert loop.force(stamp, velocity=speeds[0]) == law.answer(sample)
        loop.states.publish(held(stamp + SECOND // 200, (0.0, 0.0), (5.0, 0.0), (0.0, 0.0)))
        loop.states.wait_for_all_acked(Duration(seconds=PATIENCE))
        graph.run_for(0.02)
    assert len(loop.forces) == 3


def test_a_reference_from_a_topic_holds_until_the_next(graph: Graph) -> None:
    loop = Loop(graph, servo, **SPRING, **{"reference.kind": "topic"})
    graph.wait_until(lambda: loop.given.get_subscription_count() == 2, "it listens")
    assert loop.force(SECOND, position=0.1) == -1.0
    for number, (given, force) in enumerate(
        [(Reference(0.3), 2.0), (Reference(0.3, 5.0), 7.0), (Reference(None, 5.0), 4.0)]
    ):
        loop.references.clear()
        loop.given.publish(pack_reference(0, given))
        graph.wait_until(lambda: len(loop.references) == 1, "the reference arrives")
        stamp = (2 + number) * SECOND
        graph.wait_until(
            lambda given=given: loop.controller._given == given, "the controller has it"
        )
        assert loop.force(stamp, position=0.1) == pytest.approx(force)
    loop.given.publish(pack_reference(0, Reference(float("inf"))))
    graph.wait_until(lambda: "position inf" in loop.controller.diagnose()[1], "it is dropped")
    assert loop.force(9 * SECOND, position=0.1) == pytest.approx(4.0)


def test_it_survives_a_law_that_fails_and_says_so(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    respond = Pid.respond

    def failing(law: Pid, state: State, elapsed: float, sample: Sample, given: Reference) -> Any:
        if sample.position == 1.0:
            raise KeyError("table")
        return (
            (nan, state) if sample.position == 2.0 else respond(law, state, elapsed, sample, given)
        )

    monkeypatch.setattr(Pid, "respond", failing)
    loop = Loop(graph, servo, **SPRING, force_limit=5.0)
    assert loop.force(SECOND, 0.1) == -1.0
    dropped = "a joint state stamped {0}000000000 ns: the control law pid fails at {1} s: {2}"
    for position, reason in ((1, "KeyError: 'table'"), (2, "its force is nan, which must be")):
        stamp = (2 + position) * SECOND
        loop.states.publish(pack_joint_state(stamp, (position, 0.0), (0.0, 0.0), (0.0, 0.0)))
        told = dropped.format(2 + position, 1 + position, reason)
        graph.wait_until(lambda told=told: told in loop.controller.diagnose()[1], "it is dropped")
    assert loop.force(5 * SECOND, 0.1) == -1.0


def test_a_course_of_its_own_is_published_with_each_answer(graph: Graph) -> None:
    course = {"kind": "ramp", "amplitude": 0.4, "duration": 4.0, "start": 1.0}
    given = {f"reference.{name}": value for name, value in course.items()}
    loop = Loop(graph, servo, **SPRING, **given)
    forces = [loop.force((1 + n) * SECOND) for n in range(3)]
    assert forces == pytest.approx([0.0, 0.1, 1.1])
    graph.wait_until(lambda: len(loop.references) == 3, "references are heard")
    expected = ramp(0.4, 1.0, 4.0)
    for number, data in enumerate(loop.references):
        assert data == pack_reference((1 + number) * SECOND, expected.reference(number))


def test_a_reference_of_any_clock_is_recorded_within_the_run(graph: Graph, tmp_path: Path) -> None:
    analyzer = graph.add(AnalyzerNode, bag=str(tmp_path / "bag"))
    states, references = graph.publisher(JOINT_STATES, 1), graph.publisher(REFERENCE, 1)
    states.publish(pack_joint_state(4 * SECOND, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)))
    graph.wait_until(lambda: analyzer.diagnose()[2]["samples"] == 1, "the sample is recorded")
    for stamp in (0, 1_700_000_000 * SECOND, 5 * SECOND):
        references.publish(pack_reference(stamp, Reference(0.5, -1.0)))
    assert references.wait_for_all_acked(Duration(seconds=PATIENCE))
    graph.deactivate("analyzer")
    with Recording(tmp_path / "bag") as recording:
        logged = [stamp for _, stamp, _ in recording.messages("/test/reference")]
        assert recording.references.position.tolist() == [0.5] * 3
        assert recording.references.velocity.tolist() == [-1.0] * 3
    assert logged == [4 * SECOND, 4 * SECOND, 5 * SECOND]
