"""Layouts for Foxglove, PlotJuggler and RViz, and the model of the drive, against messages."""

import json
import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.endpoints import message_class
from stickslip_ros.nodes.base.network import environment, this_machine_only
from stickslip_ros.nodes.base.process import loopback_session
from stickslip_ros.record.codec import BELT, SLIDE, pack_joint_state, pack_wrench
from stickslip_ros.record.topics import (
    AMPLITUDE,
    APPLIED_DISTURBANCE,
    CONTROL_FORCE,
    DIAGNOSTICS,
    FREQUENCY,
    JOINT_STATES,
    STICK_FRACTION,
)
from stickslip_ros.scenarios.files import DEFAULT_NAMESPACE
from stickslip_ros.testing import own_domain
from tests.nodes.graph import Graph

CONFIG = Path(__file__).parents[2] / "config"
FOXGLOVE = json.loads((CONFIG / "foxglove_layout.json").read_text())
PLOTJUGGLER = ElementTree.parse(CONFIG / "plotjuggler_layout.xml").getroot()
RVIZ = yaml.safe_load((CONFIG / "feed_drive.rviz").read_text())["Visualization Manager"]

PLOTTED = (JOINT_STATES, CONTROL_FORCE, APPLIED_DISTURBANCE, AMPLITUDE, STICK_FRACTION, FREQUENCY)

# What does not come from our nodes: robot_state_publisher publishes it.
DESCRIPTION = f"{DEFAULT_NAMESPACE}/robot_description"

Messages = dict[str, Any]


def full_name(topic: Any) -> str:
    return topic.name if topic.name.startswith("/") else f"{DEFAULT_NAMESPACE}/{topic.name}"


@pytest.fixture(scope="module")
def messages() -> Messages:
    """A message on each topic, by the name it has by default; diagnostics are an analyzer's."""
    made = {full_name(topic): message_class(topic.type_name)() for topic in PLOTTED}
    state = pack_joint_state(0, (0, 0), (0, 0), (0, 0))
    made[full_name(JOINT_STATES)] = deserialize_message(state, JointState)
    with environment(this_machine_only()), own_domain() as domain, closing(Graph(domain)) as graph:
        heard = graph.listen(DIAGNOSTICS)
        graph.add_active(AnalyzerNode)
        heard.clear()
        graph.wait_until(lambda: heard, "it tells its health")
        made[DIAGNOSTICS.name] = heard[-1]
    return made


def foxglove_paths(plots_only: bool = False) -> list[str]:
    return [
        path["value"]
        for name, panel in FOXGLOVE["configById"].items()
        for path in [*panel.get("paths", []), *filter(None, [panel.get("xAxisPath")])]
        if name.startswith("Plot!") or not plots_only
    ]


def by_message_path(path: str, messages: Messages) -> list[Any]:
    """Return what a message path of Foxglove leads to: names, indices, slices and filters."""
    topic, _, rest = path.partition(".")
    found = [messages[topic]]
    steps = re.findall(r'\.?(\w+)|\[(\d*)(:?)\]|\{(\w+)=="([^"]*)"\}', f".{rest}")
    for name, index, colon, key, wanted in steps:
        if name:
            found = [getattr(value, name) for value in found]
        elif colon:
            found = [element for value in found for element in value]
        elif index:
            found = [value[int(index)] for value in found]
        else:
            found = [value for value in found if getattr(value, key) == wanted]
    return found


def series(topic: str, message: Any) -> Iterator[str]:
    """Yield the names that PlotJuggler gives to the numbers of a message."""
    if isinstance(message, JointState):
        for joint in message.name:
            yield from (f"{topic}/{joint}/{kind}" for kind in ("position", "velocity", "effort"))
        return
    for field in message.get_fields_and_field_types():
        value = getattr(message, field)
        if isinstance(value, float):
            yield f"{topic}/{field}"
        elif hasattr(value, "get_fields_and_field_types"):
            yield from series(f"{topic}/{field}", value)


def curves() -> set[str]:
    """The series that PlotJuggler is asked for."""
    names = set[str]()
    for plot in PLOTJUGGLER.iter("plot"):
        axes = ("curve_x", "curve_y") if plot.get("mode") == "XYPlot" else ("name",)
        names |= {curve.attrib[axis] for curve in plot.iter("curve") for axis in axes}
    return names


def test_foxglove_plots_one_number_each(messages: Messages) -> None:
    for path in set(foxglove_paths(plots_only=True)):
        (value,) = by_message_path(path, messages)
        assert isinstance(value, float), path


def test_foxglove_finds_the_regime_among_the_diagnostics(messages: Messages) -> None:
    (path,) = set(foxglove_paths()) - set(foxglove_paths(plots_only=True))
    assert f'"{DEFAULT_NAMESPACE}/analyzer"' in path
    (regime,) = by_message_path(path.replace(DEFAULT_NAMESPACE, "/test"), messages)
    assert isinstance(regime, str)


def test_the_positions_in_the_arrays_are_those_of_the_joints(messages: Messages) -> None:
    joints = messages[full_name(JOINT_STATES)].name
    labelled = [
        (int(index[0]), path["label"])
        for panel in FOXGLOVE["configById"].values()
        for path in panel.get("paths", [])
        if (index := re.findall(r"(?:position|velocity)\[(\d)\]", path["value"]))
    ]
    assert {label for _, label in labelled} == {"slide", "belt"}
    assert all(joints[index] == label for index, label in labelled)


def test_plotjuggler_finds_every_curve(messages: Messages) -> None:
    known = {name for topic, message in messages.items() for name in series(topic, message)}
    made = {snippet.attrib["name"] for snippet in PLOTJUGGLER.iter("snippet")}
    sources = {source.text for source in PLOTJUGGLER.iter("linked_source")}
    assert curves()
    assert curves() | sources <= known | made
    assert made <= curves()


def test_rviz_and_foxglove_show_the_model_where_it_is_published() -> None:
    drawn = {display["Class"]: display for display in RVIZ["Displays"]}
    model = drawn["rviz_default_plugins/RobotModel"]["Description Topic"]
    assert model["Value"] == DESCRIPTION
    force = drawn["rviz_default_plugins/Wrench"]["Topic"]
    assert force["Value"] == full_name(CONTROL_FORCE)
    (layer,) = FOXGLOVE["configById"]["3D!drive"]["layers"].values()
    assert layer["topic"] == DESCRIPTION


TEXT = (CONFIG / "feed_drive.urdf").read_text()
MODEL = ElementTree.fromstring(TEXT)
JOINTS = {joint.attrib["name"]: joint for joint in MODEL.iter("joint")}
LINKS = {link.attrib["name"] for link in MODEL.iter("link")}


def element(parent: ElementTree.Element, path: str) -> dict[str, str]:
    found = parent.find(path)
    assert found is not None, path
    return found.attrib


def test_the_free_joints_are_those_that_the_plant_publishes() -> None:
    state = deserialize_message(pack_joint_state(0, (0, 0), (0, 0), (0, 0)), JointState)
    free = [name for name, joint in JOINTS.items() if joint.find("mimic") is None]
    assert sorted(free) == sorted(state.name)
    followed = {element(JOINTS[name], "mimic")["joint"] for name in JOINTS.keys() - set(free)}
    assert followed == set(free)


def test_all_hangs_together() -> None:
    parents = {element(joint, "child")["link"]: joint for joint in JOINTS.values()}
    assert len(parents) == len(JOINTS)
    (root,) = LINKS - parents.keys()
    assert root == "base_link"
    for link in parents:
        path = [link]
        while path[-1] != root:
            path.append(element(parents[path[-1]], "parent")["link"])
            assert len(path) <= len(LINKS)


def test_slide_and_belt_move_along_x() -> None:
    for name in (SLIDE, BELT):
        assert JOINTS[name].attrib["type"] == "prismatic"
        assert element(JOINTS[name], "axis")["xyz"] == "1 0 0"


def test_the_control_force_is_drawn_at_the_slide() -> None:
    """RViz looks for the frame of the wrench among the links."""
    assert deserialize_message(pack_wrench(0, 1.0), WrenchStamped).header.frame_id in LINKS
    assert RVIZ["Global Options"]["Fixed Frame"] in LINKS


def test_ros_takes_it_as_a_parameter() -> None:
    """As robot_state_publisher is given it; it goes through a parser of YAML on its way."""
    arguments = ["--ros-args", "-p", f"robot_description:={TEXT}"]
    with own_domain() as domain, loopback_session(domain, arguments) as spinner:
        node = Node("reader", context=spinner.executor.context)
        spinner.add(node)
        text = node.declare_parameter("robot_description", "").value
    assert {joint.attrib["name"] for joint in ElementTree.fromstring(text).iter("joint")} == set(
        JOINTS
    )
