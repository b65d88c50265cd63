"""The layouts for Foxglove, PlotJuggler and RViz, against messages that the nodes publish."""

import json
import re
from collections.abc import Iterator
from math import sqrt
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from sensor_msgs.msg import JointState

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.network import this_machine_only
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.topics import (
    AMPLITUDE,
    APPLIED_DISTURBANCE,
    CONTROL_FORCE,
    DIAGNOSTICS,
    FREQUENCY,
    JOINT_STATES,
    STICK_FRACTION,
)
from stickslip_ros.scenarios.files import DEFAULT_NAMESPACE, load_scenario
from stickslip_ros.testing import own_domain
from tests.nodes.graph import Graph

CONFIG = Path(__file__).parents[2] / "config"
FOXGLOVE = json.loads((CONFIG / "foxglove_layout.json").read_text())
PLOTJUGGLER = ElementTree.parse(CONFIG / "plotjuggler_layout.xml").getroot()
RVIZ = yaml.safe_load((CONFIG / "feed_drive.rviz").read_text())["Visualization Manager"]

PLOTTED = (
    JOINT_STATES,
    CONTROL_FORCE,
    APPLIED_DISTURBANCE,
    AMPLITUDE,
    STICK_FRACTION,
    FREQUENCY,
)

# What does not come from our nodes: robot_state_publisher publishes it.
DESCRIPTION = f"{DEFAULT_NAMESPACE}/robot_description"

Messages = dict[str, Any]


def full_name(topic: Any) -> str:
    return topic.name if topic.name.startswith("/") else f"{DEFAULT_NAMESPACE}/{topic.name}"


@pytest.fixture(scope="module")
def messages() -> Messages:
    """The last message on each topic of a short run, by the name it has by default."""
    step = {"disturbance.kind": "step", "disturbance.start": 1.0, "disturbance.amplitude": 0.01}
    with pytest.MonkeyPatch.context() as environment, own_domain() as domain:
        for name, value in this_machine_only().items():
            environment.setenv(name, value)
        graph = Graph(domain)
        heard = {topic: graph.listen(topic) for topic in (*PLOTTED, DIAGNOSTICS)}
        graph.add(AnalyzerNode)
        graph.add(WashoutControllerNode, wait_for=["analyzer"], start_after=1e9)
        listeners = ["analyzer", "washout_controller"]
        graph.add(PlantNode, wait_for=listeners, duration=30.0, belt_speed=0.2, **step)

        def with_regime() -> list[Any]:
            return [
                array
                for array in heard[DIAGNOSTICS]
                if any(each.value == Regime.STICK_SLIP for each in array.status[0].values)
            ]

        graph.wait_until(lambda: all(heard.values()) and with_regime(), "all is heard")
        last = {full_name(topic): list_[-1] for topic, list_ in heard.items()}
        last[DIAGNOSTICS.name] = with_regime()[-1]
        graph.close()
    return last


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


def panels(tree: Any) -> list[str]:
    return [tree] if isinstance(tree, str) else panels(tree["first"]) + panels(tree["second"])


def test_foxglove_shows_each_panel_once() -> None:
    assert sorted(panels(FOXGLOVE["layout"])) == sorted(FOXGLOVE["configById"])


def test_foxglove_plots_one_number_each(messages: Messages) -> None:
    for path in set(foxglove_paths(plots_only=True)):
        (value,) = by_message_path(path, messages)
        assert isinstance(value, float), path


def test_foxglove_finds_the_regime_among_the_diagnostics(messages: Messages) -> None:
    (path,) = set(foxglove_paths()) - set(foxglove_paths(plots_only=True))
    assert f'"{DEFAULT_NAMESPACE}/analyzer"' in path
    assert by_message_path(path.replace(DEFAULT_NAMESPACE, "/test"), messages) == [
        Regime.STICK_SLIP
    ]


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


def test_the_phase_portrait_of_plotjuggler_is_scaled_by_the_natural_frequency() -> None:
    """Its circles are those of the drive that the layout is for."""
    plant = load_scenario("feed_drive").plant
    (function,) = PLOTJUGGLER.iter("function")
    factor = sqrt(plant.stiffness / plant.mass)
    assert function.text == f"return {factor:g} * value"


def test_plotjuggler_asks_for_the_topics_it_draws() -> None:
    (selected,) = PLOTJUGGLER.iter("selected_topics")
    assert set(selected.attrib["value"].split(";")) == {full_name(topic) for topic in PLOTTED}


def test_both_draw_what_there_is_to_draw() -> None:
    topics = {full_name(topic) for topic in PLOTTED}
    assert {path.partition(".")[0] for path in foxglove_paths(plots_only=True)} == topics
    assert {t for t in topics if any(c.startswith(f"{t}/") for c in curves())} == topics


def test_rviz_and_foxglove_show_the_model_where_it_is_published() -> None:
    drawn = {display["Class"]: display for display in RVIZ["Displays"]}
    model = drawn["rviz_default_plugins/RobotModel"]["Description Topic"]
    assert model["Value"] == DESCRIPTION
    force = drawn["rviz_default_plugins/Wrench"]["Topic"]
    assert force["Value"] == full_name(CONTROL_FORCE)
    (layer,) = FOXGLOVE["configById"]["3D!drive"]["layers"].values()
    assert layer["topic"] == DESCRIPTION
