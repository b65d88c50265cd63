"""When a plant warns about late forces and missed deadlines."""

from itertools import count

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from stickslip_ros.messages.codec import pack_wrench, unpack_header
from stickslip_ros.messages.topics import CONTROL_FORCE, DIAGNOSTICS, JOINT_STATES
from stickslip_ros.nodes.base.ros_topics import qos_profile
from stickslip_ros.nodes.lateness_warning import Punctuality
from stickslip_ros.nodes.plant import PlantNode
from tests.nodes.graph import Graph


@pytest.mark.parametrize(
    ("late", "missed", "words"),
    [
        (0, 0, ""),
        (9, 10, ""),
        (410, 0, "41 % of the latest forces came late"),
        (0, 280, "28 % of the latest samples missed their deadlines"),
        (410, 280, "41 % of the latest forces came late (the last one was held) and 28 %"),
    ],
)
def test_more_than_a_hundredth_is_a_complaint(late: int, missed: int, words: str) -> None:
    complaint = Punctuality().look(1000, late, missed, controlled=True)
    assert complaint.startswith(words)
    assert bool(complaint) == bool(words)
    if words:
        assert "lower rate or real_time_factor" in complaint


def test_only_the_latest_looks_count() -> None:
    punctuality = Punctuality()
    assert punctuality.look(1000, 100, 0, controlled=True)
    said = [punctuality.look(1000 * n, 100, 0, controlled=True) for n in range(2, 13)]
    assert said[-1] == ""


def test_without_a_controller_no_force_is_late_then_or_later() -> None:
    punctuality = Punctuality()
    assert punctuality.look(1000, 1000, 0, controlled=False) == ""
    assert punctuality.look(2000, 1005, 0, controlled=True) == ""
    assert punctuality.look(3000, 1500, 0, controlled=True) != ""


def test_a_plant_whose_controller_answers_every_third_sample_warns(
    graph: Graph, often_diagnosed: None
) -> None:
    health: list[DiagnosticArray] = graph.listen(DIAGNOSTICS)
    force = graph.observer.create_publisher(
        WrenchStamped, f"/test/{CONTROL_FORCE.name}", qos_profile(CONTROL_FORCE)
    )
    counted = count()

    def answer(message: bytes) -> None:
        if next(counted) % 3 == 0:
            force.publish(pack_wrench(unpack_header(message), 0.0))

    graph.observer.create_subscription(
        JointState, f"/test/{JOINT_STATES.name}", answer, qos_profile(JOINT_STATES), raw=True
    )
    graph.add(PlantNode, pace="realtime", rate=500.0, wait_for=["observer"])

    def warnings() -> list[str]:
        return [
            status.message
            for array in health
            for status in array.status
            if status.level == DiagnosticStatus.WARN
        ]

    graph.wait_until(lambda: any("forces came late" in said for said in warnings()), "a warning")
