"""Scenario files of any kind are read as ROS reads them, or refused, and written for it."""

import string
from pathlib import Path
from random import Random
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import load_scenario, parameter_file
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.scenarios.sections import read_file
from tests.examples import examples
from tests.scenarios.conftest import OWN, ReadByRos
from tests.scenarios.files import refusal, scenario_file, section
from tests.scenarios.fuzzed import fuzzed

NODES = ("plant", "washout_controller", "analyzer")


def taken(path: str) -> dict[str, dict[str, Any]]:
    """Return the values by node that a scenario file sets itself; raise if it is refused."""
    load_scenario(path)
    values: dict[str, dict[str, Any]] = {node: {} for node in NODE_PARAMETERS}
    found, _ = read_file(Path(path), "/feed_drive").values("/feed_drive", other_nodes=False)
    for node, name, value in found:
        values[node][name] = value
    return values


@given(seed=st.integers(0, 2**32))
@examples(quick=60, thorough=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_value_is_that_of_ros(tmp_path: Path, read_by_ros: ReadByRos, seed: int) -> None:
    path = scenario_file(tmp_path, text := fuzzed(Random(seed)))
    try:
        values = taken(path)
    except InvalidInputError:
        return
    for node in NODES:
        known, own = NODE_PARAMETERS[node].known, values[node]
        # A section for all has what only one of them knows.
        by_ros = {k: v for k, v in read_by_ros(path, node=node).items() if k in known}
        ours = {name: value for name, value in own.items() if value is not OWN.get(name)}
        # As text, an integer differs from a number, and nan is nan.
        assert repr(sorted(ours.items())) == repr(sorted(by_ros.items())), text


PLANT = "/**/plant:\n  ros__parameters:\n"
TWICE = {
    f"{PLANT}    mass: 1.0\n    mass: 2.0\n": "mass is already on line 3",
    f"{PLANT}    mass: 1.0\n{PLANT}    mass: 2.0\n": "mass is already on line 3",
    f"{PLANT}    mass: 1.0\n/**:\n  plant:\n    ros__parameters: {{mass: 2.0}}\n": "on line 3",
    f"{PLANT}    friction.static: 0.5\n    friction:\n      static: 0.4\n": "already on line 3",
    f"{PLANT}    friction: {{static: 0.5}}\n    friction: {{static: 0.4}}\n": "already on line 3",
    f"{PLANT}    mass: 1.0\n  ros__parameters:\n    mass: 2.0\n": "nothing beside ros__parameters",
    f"{PLANT}    mass: 1.0\n  other: {{}}\n": "line 4: is not YAML for ROS: there must be nothing",
    f"{PLANT}    a: {{b.c: {{d: 1}}, e: 2}}\n": "inner group must have no .",
    "/**:\n  a/plant: {ros__parameters: {mass: 1.0}}\n": "with no / in an inner one",
}


def test_what_has_two_readings_is_refused(tmp_path: Path) -> None:
    for text, reason in TWICE.items():
        assert reason in refusal(scenario_file(tmp_path, text))


def test_a_section_may_come_in_parts(tmp_path: Path, read_by_ros: ReadByRos) -> None:
    """The first part has the place at which it counts; of two sections, the later one does."""
    for first, again, rate in (
        ("/**/plant", "/**/plant", 50.0),
        ("/**/plant", "**/plant", 9.0),
        ("/**", "/**/plant", 9.0),
    ):
        later = section("/**", "{rate: 50.0}") + section(again, "{rate: 9.0}")
        path = scenario_file(tmp_path, section(first, "\n    mass: 120.0") + later)
        plant = load_scenario(path).plant
        assert {"mass": plant.mass, "rate": plant.rate} == {"mass": 120.0, "rate": rate}
        assert read_by_ros(path) == {"mass": 120.0, "rate": rate}


# Texts that a reader of YAML may take for something else.
AMBIGUOUS = ["1e3", "08", "0x10", "1_000", "1.5", "12:30", "yes", "n", "y", "inf", "nan"]
AMBIGUOUS += ["~", "null", "-", "a: b", "#a", " a ", "", "'", '"', "[a]", "*a", "&a", "!a", "a\nb"]


@given(
    st.sampled_from(AMBIGUOUS) | st.text(string.printable),
    st.lists(
        st.sampled_from([text for text in AMBIGUOUS if text.isidentifier()])
        | st.text(string.ascii_letters, min_size=1),
        min_size=1,
    ),
    st.floats(-1e30, 1e30, allow_subnormal=False),  # which rcl does not read
    st.floats(min_value=0.0, allow_nan=False, allow_subnormal=False),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_value_is_taken_for_another(
    tmp_path: Path, text: str, texts: list[str], number: float, duration: float
) -> None:
    values: dict[str, dict[str, Any]] = {
        "plant": {"wait_for": texts, "initial.position": number, "duration": duration},
        "analyzer": {"bag": text},
    }
    path = scenario_file(tmp_path, parameter_file(values))
    read = load_scenario(path).as_dict()
    for node, parameters in values.items():
        assert {name: read[node][name] for name in parameters} == parameters


def test_ros_reads_the_same(tmp_path: Path, read_by_ros: ReadByRos) -> None:
    plant = PlantParameters().changed({"belt_speed": 1e-7, "wait_for": ["analyzer"]}, "test")
    values = plant.flat()
    path = scenario_file(tmp_path, parameter_file({"plant": values, "analyzer": {"wait_for": []}}))
    assert Path(path).read_text().count("wait_for") == 1  # ROS has no empty list
    del values["use_sim_time"]  # which a node declares by itself
    read = read_by_ros(path)
    assert {name: repr(value) for name, value in read.items()} == {
        name: repr(values[name]) for name in read
    }
    texts = {f"p{number}": text for number, text in enumerate(AMBIGUOUS)}
    assert read_by_ros(scenario_file(tmp_path, parameter_file({"plant": texts}))) == texts
