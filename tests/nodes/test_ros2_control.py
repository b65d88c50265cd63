"""The plant behind a hardware interface of ros2_control."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.record.codec import joint_state_columns
from stickslip_ros.record.topics import CLOCK, JOINT_COMMANDS, JOINT_STATES, force_topics
from stickslip_ros.samples import SampleColumns
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from tests.nodes.graph import PATIENCE, Graph
from tests.nodes.ros2_control import HardwareInterface

SAMPLES = 2_000
EXAMPLE = Path(__file__).parents[2] / "examples" / "ros2_control"


def law(velocity: float) -> float:
    return -3000.0 * velocity


def start(graph: Graph, threshold: float, **parameters: Any) -> tuple[Any, HardwareInterface]:
    """Add a plant and its hardware interface; they hear each other."""
    interface = HardwareInterface(graph.observer, law, threshold=threshold)
    own = load_scenario("feed_drive").plant.flat() | {
        "pace": "lockstep", "duration": SAMPLES * 1e-3, "command_rule": "newest",
        "effort": "actuator", "autostart": False,
    }  # fmt: skip
    plant = graph.add(PlantNode, **{**own, **parameters})
    plant.trigger_configure()
    graph.wait_until(
        lambda: interface.readers == 1 and plant.read_last.get_subscription_count() > 1, "matched"
    )
    return plant, interface


def run(graph: Graph, plant: Any, heard: list[Any]) -> tuple[SampleColumns, dict[str, Any]]:
    """Run to the end; return the joint states and the counts of the plant."""
    heard.clear()
    plant.trigger_activate()
    graph.wait_until(lambda: not plant.active, "the plant pauses")
    counts = plant.diagnose()[2]
    graph.wait_until(lambda: len(heard) == counts["samples"], "all is heard")
    return joint_state_columns([bytes(message) for message in heard])[0], counts


def at_rest(states: SampleColumns) -> bool:
    return bool(np.abs(states.velocity[-20:]).max() < 1e-4)


def test_triggered_by_the_state_each_sample_is_answered_and_again_the_same(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    # However slow the machine, no sample goes without its command.
    plant, interface = start(graph, -1.0, command_timeout=PATIENCE, reply_timeout=PATIENCE)
    interface.on_state = interface.cycle
    first, counts = run(graph, plant, heard)
    assert (counts["silent_samples"], counts["late_forces"], counts["superseded"]) == (0, 0, 0)
    assert counts["dropped_messages"] == 0
    assert interface.published >= SAMPLES
    assert at_rest(first)
    assert first.friction_force[1:] == pytest.approx(law(1.0) * first.velocity[:-1], abs=1e-9)
    plant.trigger_cleanup()
    plant.trigger_configure()
    graph.wait_until(lambda: interface.readers == 1, "matched")
    again, counts = run(graph, plant, heard)
    assert counts["silent_samples"] == 0
    for name in ("position", "velocity", "friction_force"):
        assert np.array_equal(getattr(first, name), getattr(again, name))


def test_driven_by_the_clock_a_command_is_at_most_one_sample_late(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    plant, interface = start(graph, -1.0, publish_clock=True)
    late: list[float] = []

    def tick(clock: Clock) -> None:
        stamp = interface.stamp
        late.append(clock.clock.sec - stamp.sec + 1e-9 * (clock.clock.nanosec - stamp.nanosec))
        interface.cycle()

    graph.subscribe(CLOCK, tick, raw=False)
    states, counts = run(graph, plant, heard)
    assert max(late[1:]) < 1.5e-3
    assert at_rest(states)
    assert counts["dropped_messages"] == 0


def test_a_silent_interface_lets_the_last_force_act(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    plant, interface = start(graph, 1e-5, command_timeout=0.002, duration=1.5)
    interface.on_state = interface.cycle
    states, counts = run(graph, plant, heard)
    assert counts["silent_samples"] > 0
    answered = min(interface.published, counts["samples"] - 1)
    assert answered + counts["silent_samples"] >= counts["samples"] - 1
    assert (counts["late_forces"], counts["dropped_messages"]) == (0, 0)
    assert at_rest(states)


def test_in_real_time_each_command_acts_when_it_comes(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    pace = {"pace": "realtime", "real_time_factor": 0.5, "rate": 250.0, "duration": 1.5}
    plant, interface = start(graph, -1.0, **pace)
    graph.observer.create_timer(0.008, interface.cycle)
    states, counts = run(graph, plant, heard)
    assert counts["dropped_messages"] == 0
    # Each force answers a sample before it, and none an older one than the force before.
    answered = 0
    for number, force in enumerate(states.friction_force[1:]):
        while abs(force - law(states.velocity[answered])) > 1e-9:
            answered += 1
        assert answered <= number
    assert answered > 10


def test_a_force_of_an_array_acts_as_the_newest(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES)
    kind = "std_msgs/msg/Float64MultiArray"
    force = graph.publisher(force_topics(kind)[0])
    plant = graph.add(
        PlantNode, command_rule="newest", command_timeout=PATIENCE, reply_timeout=PATIENCE,
        force_type=kind, force_number=2, effort="actuator", wait_for=["observer"],
    )  # fmt: skip
    for number in range(4):
        graph.wait_until(lambda n=number: len(heard) > n, "the sample")
        force.publish(Float64MultiArray(data=[7.0, 0.25 * number]))
    graph.wait_until(lambda: len(heard) == 5, "the last sample")
    assert [state.effort[0] for state in heard[1:]] == [0.0, 0.25, 0.5, 0.75]
    force.publish(Float64MultiArray(data=[7.0]))
    graph.wait_until(lambda: "no number 2" in plant.dropped.complaint, "it is refused")
    with pytest.raises(InvalidInputError, match=r"force_type .* command_rule must be newest"):
        load_scenario("paper", [f"plant.force_type={kind}"])


def test_commands_without_an_effort_of_the_slide_are_refused_and_counted(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES)
    plant, interface = start(graph, -1.0, slide_name="axis", belt_name="conveyor")
    plant.trigger_activate()
    graph.wait_until(lambda: heard, "the first sample")
    assert list(heard[0].name) == ["axis", "conveyor"]
    for effort in ([], [1.0, 2.0, 3.0]):
        interface.publish(JointState(name=["axis", "gripper"], effort=effort))
    graph.wait_until(lambda: plant.dropped.values["dropped_messages"] == 2, "both are refused")
    assert "efforts; must be one, or one for each joint" in plant.dropped.complaint


def test_the_example_names_the_topics_and_the_rate_of_the_plant() -> None:
    hardware = ElementTree.parse(EXAMPLE / "feed_drive.urdf").getroot().find("ros2_control")
    assert hardware is not None
    topics = {each.get("name"): each.text for each in hardware.iterfind("hardware/param")}
    for topic in (JOINT_COMMANDS, JOINT_STATES):
        assert topics[f"{topic.name}_topic"] == f"/feed_drive/{topic.name}"
    joint = hardware.find("joint")
    assert joint is not None
    assert joint.get("name") == PlantParameters().slide_name
    manager = yaml.safe_load((EXAMPLE / "controllers.yaml").read_text())["controller_manager"]
    rate = load_scenario("feed_drive").plant.rate
    assert manager["ros__parameters"]["update_rate"] == rate
