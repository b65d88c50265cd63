"""The washout controller node on the real middleware."""

from math import nan

import pytest
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from stickslip_ros.messages.codec import pack_joint_state, unpack_wrench
from stickslip_ros.messages.topics import CONTROL_FORCE, JOINT_STATES
from stickslip_ros.nodes.base.ros_topics import qos_profile
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.model.control import Washout
from stickslip_ros.samples import Sample
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS
from tests.nodes.graph import Graph

SECOND = 1_000_000_000


def _sample(stamp: int, velocity: float) -> Sample:
    return Sample(stamp, 0.0, velocity, 0.0, 0.0, 0.4)


class Loop:
    """Sends joint states to a controller and hears its forces."""

    def __init__(self, graph: Graph, **parameters: object) -> None:
        self.graph = graph
        self.forces = graph.listen(CONTROL_FORCE, raw=True)
        self.controller = graph.add(WashoutControllerNode, wait_for=["observer"], **parameters)
        self.states = graph.observer.create_publisher(
            JointState, f"/test/{JOINT_STATES.name}", qos_profile(JOINT_STATES)
        )
        graph.wait_until(
            lambda: self.controller.active and self.states.get_subscription_count() == 1,
            "controller listens",
        )

    def send(self, stamp: int, velocity: float) -> None:
        """Send a state, without waiting for the answer."""
        self.states.publish(pack_joint_state(stamp, (0.0, 0.0), (velocity, 0.4), (0.0, 0.0)))

    def answer(self, stamp: int, velocity: float) -> tuple[int, float]:
        """Send a state and return stamp and force of the answer."""
        heard = len(self.forces)
        self.send(stamp, velocity)
        self.graph.wait_until(lambda: len(self.forces) > heard, f"answer to {stamp}")
        return unpack_wrench(self.forces[-1])


def test_each_state_is_answered_with_the_force_of_the_law(graph: Graph) -> None:
    loop = Loop(graph, corner_frequency=3.0, linear_gain=-2.0, cubic_gain=-0.5)
    law = Controller(Washout(3.0, -2.0, -0.5))
    for number, velocity in enumerate((0.1, 0.3, -0.2, 0.05)):
        stamp = SECOND + number * 7_000_000
        assert loop.answer(stamp, velocity) == (stamp, law.answer(_sample(stamp, velocity)))
    assert unpack_wrench(loop.forces[0])[1] == 0.0


def test_what_is_not_a_finite_state_is_dropped_and_diagnosed(graph: Graph) -> None:
    loop = Loop(graph)
    loop.answer(SECOND, 0.1)
    loop.send(2 * SECOND, nan)
    graph.wait_until(lambda: "velocity nan" in loop.controller.diagnose()[1], "NaN is dropped")
    loop.states.publish(b"\x00\x01\x00\x00 nothing")
    graph.wait_until(lambda: "ends after" in loop.controller.diagnose()[1], "garbage is dropped")
    stamp, _ = loop.answer(3 * SECOND, 0.1)
    assert stamp == 3 * SECOND
    assert len(loop.forces) == 2


def test_a_state_older_than_the_last_is_dropped_and_the_filter_goes_on(graph: Graph) -> None:
    loop = Loop(graph)
    law = CONTROLLER_PARAMETERS["washout"]().as_controller()
    for number, velocity in enumerate((0.1, 0.3, -0.2)):
        stamp = SECOND + number * SECOND // 100
        assert loop.answer(stamp, velocity) == (stamp, law.answer(_sample(stamp, velocity)))
    loop.send(SECOND + SECOND // 100, 0.3)
    graph.wait_until(lambda: "not later than the last" in loop.controller.diagnose()[1], "dropped")
    later = 2 * SECOND
    assert loop.answer(later, 0.4) == (later, law.answer(_sample(later, 0.4)))
    assert len(loop.forces) == 4


def test_a_plant_in_lockstep_that_was_started_again_is_answered_at_once(graph: Graph) -> None:
    loop = Loop(graph)
    heard: list[list[tuple[int, float]]] = []
    for _ in range(2):
        heard.append(
            [loop.answer(SECOND + n * SECOND // 100, v) for n, v in enumerate((0.1, 0.3, -0.2))]
        )
    assert heard[0] == heard[1]


def test_an_inactive_controller_is_silent(graph: Graph) -> None:
    loop = Loop(graph)
    loop.controller.trigger_deactivate()
    loop.send(SECOND, 0.1)
    loop.controller.trigger_activate()
    stamp, force = loop.answer(2 * SECOND, 0.3)
    assert (stamp, force) == (2 * SECOND, 0.0)
    assert len(loop.forces) == 1


def test_gains_change_while_running(graph: Graph) -> None:
    loop = Loop(graph, corner_frequency=1e-9, linear_gain=-1.0, cubic_gain=0.0)
    loop.answer(SECOND, 0.0)
    assert loop.answer(2 * SECOND, 0.5)[1] == pytest.approx(-0.5, rel=1e-6)
    loop.controller.set_parameters([Parameter("linear_gain", value=-4)])
    assert loop.answer(3 * SECOND, 0.5)[1] == pytest.approx(-2.0, rel=1e-6)
    (refused,) = loop.controller.set_parameters([Parameter("corner_frequency", value=0.0)])
    assert not refused.successful
    assert "corner_frequency = 0.0" in refused.reason
