"""Parameters set over the network while the nodes run: refused by name or applied exactly."""

import random
import re
from collections.abc import Iterator
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter as RosParameter
from rclpy.parameter import parameter_dict_from_yaml_file, parameter_value_to_python

from stickslip_ros.model.constants import Changes
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.managed import ERROR, ManagedNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.replay import ReplayNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.codec import joint_state_columns
from stickslip_ros.record.topics import JOINT_STATES
from tests.nodes.graph import Graph
from tests.scenarios import values
from tests.scenarios.values import CONFLICTS, MODELS, UNKNOWN, bad_values, good_values

SECOND = 1_000_000_000
LEFT_OPEN = {
    "unconfigured": (Changes.LIVE, Changes.AT_REST, Changes.AT_BUILD),
    "inactive": (Changes.LIVE, Changes.AT_REST),
    "active": (Changes.LIVE,),
}
"""By state: which parameters may still be set."""
NODES: dict[str, type[ManagedNode[Any]]] = {
    "plant": PlantNode,
    "washout_controller": WashoutControllerNode,
    "analyzer": AnalyzerNode,
    "replay": ReplayNode,
}


def message(name: str, value: Any) -> ParameterMessage:
    return RosParameter(name, value=value).to_parameter_msg()


def set_each(graph: Graph, node: str, *changes: tuple[str, Any]) -> list[str]:
    """Set the parameters one by one in one request; return why each is refused, or nothing."""
    request = SetParameters.Request(parameters=[message(*change) for change in changes])
    results = graph.call(SetParameters, f"/test/{node}/set_parameters", request).results
    return [result.reason or "no reason" if not result.successful else "" for result in results]


def set_all(graph: Graph, node: str, **changes: Any) -> str:
    """Set the parameters all at once; return why they are refused, or nothing."""
    parameters = [message(name.replace("__", "."), value) for name, value in changes.items()]
    request = SetParametersAtomically.Request(parameters=parameters)
    name = f"/test/{node}/set_parameters_atomically"
    result = graph.call(SetParametersAtomically, name, request).result
    return result.reason or "no reason" if not result.successful else ""


def told(graph: Graph, node: str) -> dict[str, Any]:
    """Return the node's parameters as it tells them."""
    names = [parameter.name for parameter in MODELS[node].known.values()]
    request = GetParameters.Request(names=names)
    values = graph.call(GetParameters, f"/test/{node}/get_parameters", request).values
    found = [parameter_value_to_python(value) for value in values]
    return dict(zip(names, found, strict=True))


def bits(parameters: dict[str, Any]) -> dict[str, Any]:
    return {name: values.bits(value) for name, value in parameters.items()}


def in_turn(node: Any) -> Iterator[str]:
    """Bring the node into each state in which it lives."""
    yield "unconfigured"
    node.trigger_configure()
    yield "inactive"
    node.trigger_activate()
    yield "active"


@pytest.mark.parametrize("name", list(NODES)[:3])
def test_bad_values_are_refused_in_every_state_and_change_nothing(graph: Graph, name: str) -> None:
    given = {"pace": "realtime"} if name == "plant" else {}
    node = graph.add(NODES[name], autostart=False, **given)
    bad = [
        (parameter.name, value)
        for parameter in MODELS[name].known.values()
        for value in bad_values(parameter)
    ]
    unknown = [item for item in UNKNOWN.items() if item[0] not in told(graph, name)]
    for state in in_turn(node):
        before = bits(told(graph, name))
        reasons = set_each(graph, name, *bad, *unknown)
        for (parameter, value), reason in zip(bad, reasons, strict=False):
            assert f"/test/{name}: {parameter} = " in reason, (state, parameter, value)
            assert re.search(" is (invalid|refused): ", reason)
        for (parameter, _), reason in zip(unknown, reasons[len(bad) :], strict=True):
            assert f"/test/{name}: unknown parameter {parameter:.80} = " in reason, state
        assert bits(told(graph, name)) == before == bits(node.parameters.flat())
    assert node.active


@pytest.mark.parametrize("name", NODES)
def test_good_values_are_taken_exactly_in_every_state(graph: Graph, name: str) -> None:
    node = graph.add(NODES[name], autostart=False)
    known = list(MODELS[name].known.values())
    states = in_turn(node) if name != "replay" else ["unconfigured"]  # it would want a bag
    for state, choice in zip(states, (-1, -2, -1), strict=False):
        start = told(graph, name)
        settable = {p.name for p in known if p.changes in LEFT_OPEN[state]}
        changes = [(p.name, good_values(p)[max(choice, -len(good_values(p)))]) for p in known]
        reasons = set_each(graph, name, *changes)
        now = bits(told(graph, name))
        assert now == bits(node.parameters.flat())
        for (parameter, value), reason in zip(changes, reasons, strict=True):
            assert now[parameter] == bits(start if reason else {parameter: value})[parameter]
            allowed = CONFLICTS if reason else ("",)
            if parameter not in settable and value != start[parameter]:
                allowed += (f"{parameter} cannot be changed while the node is ",)
                assert reason
            assert any(part in reason for part in allowed), (state, parameter, value, reason)
        assert set_all(graph, name, **{name: start[name] for name in settable}) == ""
        assert bits(told(graph, name)) == bits(start)


@pytest.mark.parametrize("name", ["plant", "replay"])
def test_what_ros2_dumps_it_loads_again(graph: Graph, name: str, tmp_path: Path) -> None:
    node = graph.add(NODES[name], autostart=False)
    given = {p.name: good_values(p)[-1] for p in MODELS[name].known.values() if p.kind is float}
    given |= {"friction.minimum_speed": 1e-5, "friction.minimum": 0.0, "friction.static": 5e-5}
    for choice in ({n: v for n, v in given.items() if n in told(graph, name)}, {}):
        set_each(graph, name, *choice.items())
        before = bits(told(graph, name))
        service = f"/test/{name}/list_parameters"
        answer = graph.call(ListParameters, service, ListParameters.Request())
        names = sorted(answer.result.names)
        request = GetParameters.Request(names=names)
        values = graph.call(GetParameters, f"/test/{name}/get_parameters", request).values
        dumped = dict(zip(names, map(parameter_value_to_python, values), strict=True))
        file = tmp_path / "dump.yaml"
        file.write_text(yaml.dump({f"/test/{name}": {"ros__parameters": dumped}}))
        parameters = parameter_dict_from_yaml_file(str(file), use_wildcard=True)  # as `param load`
        request = SetParameters.Request(parameters=list(parameters.values()))
        results = graph.call(SetParameters, f"/test/{name}/set_parameters", request).results
        assert [result.reason for result in results if not result.successful] == []
        assert bits(told(graph, name)) == before == bits(node.parameters.flat())
    (reason,) = set_each(graph, name, ("start_type_description_service", False))
    assert "read-only" in reason


def test_text_is_a_number_where_ros_reads_one_and_is_told_otherwise(graph: Graph) -> None:
    graph.add(PlantNode, autostart=False)
    texts = [("mass", "1.0e6"), ("duration", "inf"), ("duration", ".inf"), ("damping", "5")]
    assert set_each(graph, "plant", *texts) == [""] * 4
    now = told(graph, "plant")
    assert (now["mass"], now["duration"], now["damping"]) == (1e6, inf, 5.0)
    for name, text in (
        ("mass", "heavy"),
        ("mass", "1e400"),
        ("rate", "1_0"),
        ("autostart", "maybe"),
    ):
        (reason,) = set_each(graph, "plant", (name, text))
        assert f"{name} = {text!r} is invalid: must be " in reason
        assert reason.endswith(", not text")
    (reason,) = set_each(graph, "plant", ("mass", "-1e-05"))
    assert "mass = -1e-05 is invalid" in reason


def test_ranges_tell_the_bounds_wherever_a_slider_can_show_them(graph: Graph) -> None:
    expected = {
        "plant": {
            "mass": (1e-30, 1e30),
            "damping": (0.0, 1e30),
            "rate": (1e-6, 1e9),
            "flow_window": (200, 4000),
            "force_jitter_seed": (0, 1_000_000_000),
        },
        "analyzer": {"window": (1, 100_000), "max_bag_duration": (0.0, 1e9)},
    }
    for name, some in expected.items():
        graph.add(NODES[name], autostart=False)
        known = list(MODELS[name].known.values())
        request = DescribeParameters.Request(names=[parameter.name for parameter in known])
        answer = graph.call(DescribeParameters, f"/test/{name}/describe_parameters", request)
        ranges: dict[str, tuple[float, float]] = {}
        for descriptor in answer.descriptors:
            for each in (*descriptor.floating_point_range, *descriptor.integer_range):
                ranges[descriptor.name] = (each.from_value, each.to_value)
                assert isfinite(each.to_value - each.from_value)
                assert each.step == 0
        assert some.items() <= ranges.items()
        assert not ranges.keys() & {"belt_speed", "duration", "max_bag_size", "autostart"}


def test_one_bad_value_refuses_all(graph: Graph) -> None:
    node = graph.add(PlantNode, autostart=False)
    for _ in in_turn(node):
        before = told(graph, "plant")
        good = {
            p.name: good_values(p)[0]
            for p in MODELS["plant"].known.values()
            if p.changes is Changes.LIVE
        }
        for name, bad in (("mass", 0.0), ("friction.law", "dry"), ("masss", 1.0), ("mass", None)):
            reason = set_all(graph, "plant", **(good | {name: bad}))
            assert f"{name} = {bad!r}" in reason
            assert bits(told(graph, "plant")) == bits(before) == bits(node.parameters.flat())
        together = {"friction.static": 0.2, "friction.minimum": 0.1}
        assert set_each(graph, "plant", *together.items())[0] != ""
        assert set_all(graph, "plant", **together) == ""
        assert bits(told(graph, "plant")) == bits(before | together)
        assert set_all(graph, "plant", **before) == ""


def test_what_is_set_while_inactive_acts_when_it_is_activated(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    plant = graph.add(PlantNode, autostart=False, expects_control=False, wait_for=["observer"])
    plant.trigger_configure()
    changes = {"rate": 10.0, "duration": 1.0, "initial.position": 0.25, "friction.law": "coulomb"}
    assert set_all(graph, "plant", **changes) == ""
    assert "while the node is configured" in set_all(graph, "plant", publish_clock=True)
    graph.wait_until(lambda: not plant.missing_peers(), "the observer is there")
    plant.trigger_activate()
    graph.wait_until(lambda: len(heard) == 11 and not plant.active, "eleven samples")
    columns, _ = joint_state_columns(heard)
    assert np.diff(columns.stamp).tolist() == [SECOND // 10] * 10
    assert columns.position[0] == 0.25
    assert columns.friction_force[0] == 0.4
    assert set_all(graph, "plant", **{"initial.position": -1.0}) == ""
    plant.trigger_activate()
    graph.wait_until(lambda: len(heard) == 22, "it goes on")
    columns, _ = joint_state_columns(heard)
    assert columns.position[11] == columns.position[10]


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
def test_a_motion_that_has_become_too_stiff_pauses_the_plant(
    graph: Graph, pace: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip_ros.motion.hybrid_motion._SPARE_STEPS", 1000)
    heard = graph.listen(JOINT_STATES, raw=True)
    plant = graph.add(PlantNode, pace=pace, expects_control=False, wait_for=["observer"])
    graph.wait_until(lambda: plant.active and heard, "samples come")
    assert set_all(graph, "plant", damping=1e12) == ""
    graph.wait_until(lambda: not plant.active, "the plant pauses")
    level, message, _ = plant.diagnose()
    assert level == ERROR
    assert "too stiff" in message
    assert set_all(graph, "plant", damping=0.02) == ""
    before = len(heard)
    plant.trigger_activate()
    graph.wait_until(lambda: len(heard) > before + 10, "it goes on")


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
@pytest.mark.long
def test_thousands_of_changes_leave_the_motion_continuous(graph: Graph, pace: str) -> None:
    period = 1e-3
    heard = graph.listen(JOINT_STATES, raw=True)

    def wait_for_more(samples: int) -> None:
        count = len(heard)
        graph.wait_until(lambda: len(heard) > count + samples, "samples go on coming")

    controller = graph.add(WashoutControllerNode, force_limit=0.5)
    waiting = ["observer", "washout_controller"]
    plant = graph.add(
        PlantNode, pace=pace, rate=1.0 / period, wait_for=waiting, **{"friction.slope": 0.01}
    )
    graph.wait_until(lambda: plant.active and len(heard) > 100, "samples come")
    rival = graph.observer.create_client(
        SetParametersAtomically, "/test/plant/set_parameters_atomically"
    )
    draw = random.Random(1)
    for _ in range(10):
        changes = [drawn(draw) for _ in range(150)]
        request = SetParametersAtomically.Request(
            parameters=[message(*change) for change in dict(drawn(draw) for _ in range(3)).items()]
        )
        if rival.service_is_ready():
            rival.call_async(request)
        reasons = set_each(graph, "plant", *changes)
        for (name, value), reason in zip(changes, reasons, strict=True):
            assert not reason or f"{name} = {value!r}" in reason
        gains = [
            ("linear_gain", draw.uniform(-1.0, 0.0)),
            ("corner_frequency", draw.uniform(0.1, 9.0)),
        ]
        assert set_each(graph, "washout_controller", *gains) == ["", ""]
        wait_for_more(20)
    assert bits(told(graph, "plant")) == bits(plant.parameters.flat())
    assert bits(told(graph, "washout_controller")) == bits(controller.parameters.flat())
    wait_for_more(2000)

    columns, refused = joint_state_columns(heard)
    assert refused.number == 0
    assert columns.belt_velocity[-1] == plant.parameters.belt_speed
    position, velocity = columns.position, columns.velocity
    assert np.isfinite([position, velocity, columns.friction_force]).all()
    next_to_each_other = np.diff(columns.stamp) == round(period * SECOND)
    assert next_to_each_other.mean() > 0.9
    fastest = np.maximum(np.abs(velocity[1:]), np.abs(velocity[:-1]))
    # Spring, damper, friction, control and disturbance, on half a kilogram.
    force = 2.0 * np.abs(position[:-1]) + 0.2 * fastest + 2.0 * 10.0 + 0.5 + 1.0
    leap = np.abs(np.diff(velocity)) > period * force / 0.5
    jump = np.abs(np.diff(position)) > period * (fastest + period * force / 0.5)
    assert not (leap & next_to_each_other).any()
    assert not (jump & next_to_each_other).any()


def drawn(draw: random.Random) -> tuple[str, Any]:
    """Return a change of the plant, bad one time in some."""
    ranges: dict[str, tuple[float, float]] = {
        "mass": (0.5, 2.0),
        "stiffness": (0.5, 2.0),
        "damping": (-0.02, 0.2),
        "normal_force": (0.5, 2.0),
        "belt_speed": (-0.5, 0.5),
        "friction.static": (0.2, 0.5),
        "friction.minimum": (0.0, 0.25),
        "friction.kinetic": (0.0, 0.25),
        "disturbance.amplitude": (-1.0, 1.0),
        "disturbance.frequency": (-0.1, 5.0),
    }
    texts = {
        "friction.law": ["stribeck", "coulomb", "linear", "exponential", "dry"],
        "disturbance.kind": ["none", "step", "sine", "on"],
    }
    name = draw.choice([*ranges, *texts])
    return name, draw.uniform(*ranges[name]) if name in ranges else draw.choice(texts[name])


def test_what_has_no_effect_is_taken_with_the_reason(graph: Graph) -> None:
    """Set one by one: the duration of a ramp must come before its kind."""
    plant = graph.add(PlantNode, autostart=False)
    unused = plant.set_parameters([RosParameter("disturbance.duration", value=2.0)])[0]
    assert unused.successful
    assert "disturbance.duration is not used by the kind none; kinds that use it" in unused.reason
    for name, value in (("disturbance.kind", "ramp"), ("friction.law", "coulomb"), ("mass", 2.0)):
        (result,) = plant.set_parameters([RosParameter(name, value=value)])
        assert (result.successful, result.reason) == (True, "")
    again = plant.set_parameters([RosParameter("friction.minimum", value=0.25)])[0]
    assert (again.successful, again.reason) == (True, "")
