"""The model of the drive for robot_state_publisher, and its moving parts."""

from math import pi
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from stickslip_ros.nodes.base.process import loopback_session
from stickslip_ros.record.codec import BELT, SLIDE, pack_joint_state, pack_wrench
from stickslip_ros.testing import own_domain

CONFIG = Path(__file__).parents[2] / "config"
TEXT = (CONFIG / "feed_drive.urdf").read_text()
MODEL = ElementTree.fromstring(TEXT)
JOINTS = {joint.attrib["name"]: joint for joint in MODEL.iter("joint")}
LINKS = {link.attrib["name"] for link in MODEL.iter("link")}
PULLEYS = ("drive_pulley", "idler_pulley")


def element(parent: ElementTree.Element, path: str) -> dict[str, str]:
    found = parent.find(path)
    assert found is not None, path
    return found.attrib


def vector(text: str) -> np.ndarray:
    return np.array(text.split(), float)


def mimicked(name: str) -> tuple[str, float]:
    """The joint that this one follows, and how many rad or m per m."""
    mimic = element(JOINTS[name], "mimic")
    return mimic["joint"], float(mimic["multiplier"])


def test_the_free_joints_are_those_that_the_plant_publishes() -> None:
    state = deserialize_message(pack_joint_state(0, (0, 0), (0, 0), (0, 0)), JointState)
    free = [name for name, joint in JOINTS.items() if joint.find("mimic") is None]
    assert sorted(free) == sorted(state.name)
    followed = {mimicked(name)[0] for name in JOINTS.keys() - set(free)}
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
        assert vector(element(JOINTS[name], "axis")["xyz"]) == pytest.approx([1, 0, 0])


@pytest.mark.parametrize("name", PULLEYS)
def test_the_pulleys_roll_on_the_belt(name: str) -> None:
    """Their tops move as far as the belt, which lies on them."""
    joint, multiplier = mimicked(name)
    assert joint == BELT
    assert JOINTS[name].attrib["type"] == "continuous"
    axis = vector(element(JOINTS[name], "axis")["xyz"])
    (link,) = (link for link in MODEL.iter("link") if link.attrib["name"] == name)
    top = np.array([0, 0, float(element(link, ".//cylinder")["radius"])])
    assert np.cross(multiplier * axis, top) == pytest.approx([1, 0, 0])
    axle = vector(element(JOINTS[name], "origin")["xyz"])
    (base,) = (link for link in MODEL.iter("link") if link.attrib["name"] == "base_link")
    strand = "visual[@name='upper_strand']"
    height = vector(element(base, f"{strand}/origin")["xyz"])[2]
    thickness = vector(element(base, f"{strand}/geometry/box")["size"])[2]
    assert (axle + top)[2] == pytest.approx(height - thickness / 2)
    surface = vector(element(JOINTS[SLIDE], "origin")["xyz"])[2]
    assert surface == pytest.approx(height + thickness / 2)


def test_the_needle_turns_once_per_millimetre() -> None:
    joint, multiplier = mimicked("dial_needle")
    assert joint == SLIDE
    assert multiplier * 1e-3 == pytest.approx(2 * pi)


def test_the_control_force_is_drawn_at_the_slide() -> None:
    """RViz looks for the frame of the wrench among the links."""
    assert deserialize_message(pack_wrench(0, 1.0), WrenchStamped).header.frame_id in LINKS
    rviz = yaml.safe_load((CONFIG / "feed_drive.rviz").read_text())
    assert rviz["Visualization Manager"]["Global Options"]["Fixed Frame"] in LINKS


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
