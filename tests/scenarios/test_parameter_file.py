"""Parameter files written from values, for the nodes that bringup starts and for the bag."""

import string
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stickslip_ros.scenarios.files import load_scenario, parameter_file
from stickslip_ros.scenarios.parameters import PlantParameters
from tests.scenarios.conftest import ReadByRos
from tests.scenarios.files import scenario_file

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
