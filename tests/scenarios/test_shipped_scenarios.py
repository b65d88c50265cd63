import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from stickslip_ros.scenarios.files import load_scenario, parameter_file
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, NODE_PARAMETERS
from stickslip_ros.scenarios.ros_yaml import number_in

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"

STRIBECK = {"friction.law": "stribeck", "friction.static": 0.4, "friction.minimum": 0.25}
SLIDE = STRIBECK | {
    "mass": 100.0,
    "stiffness": 1e6,
    "damping": 200.0,
    "normal_force": 1000.0,
    "friction.minimum_speed": 0.05,
    "rate": 1000.0,
    "pace": "realtime",
}
WASHOUT = {"corner_frequency": 20.0, "linear_gain": -3000.0, "cubic_gain": 0.0}
SHIPPED: dict[str, dict[str, dict[str, Any]]] = {
    "paper": {
        "plant": STRIBECK
        | {
            "mass": 1.0,
            "stiffness": 1.0,
            "damping": 0.02,
            "normal_force": 1.0,
            "belt_speed": 0.4,
            "friction.minimum_speed": 0.5,
            "rate": 100.0,
            "pace": "lockstep",
        },
        "washout_controller": {
            "corner_frequency": 2.0,
            "linear_gain": -1.0,
            "cubic_gain": -1.0,
            "start_after": 0.0,
        },
    },
    "feed_drive": {
        "plant": SLIDE | {"belt_speed": 0.04},
        "washout_controller": WASHOUT | {"start_after": 5.0},
    },
    "feed_profile": {
        "plant": SLIDE
        | {
            "belt_speed": 0.0,
            "belt.kind": "table",
            "belt.file": str(CONFIG / "feed_profile.csv"),
            "duration": 13.0,
        },
        "washout_controller": WASHOUT | {"start_after": 4.0},
    },
    "vibrating_load": {
        "plant": SLIDE
        | {
            "belt_speed": 0.04,
            "load.kind": "sine",
            "load.amplitude": 300.0,
            "load.frequency": 50.0,
        },
        "washout_controller": WASHOUT | {"start_after": 5.0},
    },
    "axis": {
        "plant": {
            "friction.law": "coulomb",
            "mass": 95.154,
            "stiffness": 0.0,
            "damping": 0.0,
            "normal_force": 1000.0,
            "belt_speed": 0.0,
            "bias_force": 3.1648,
            "friction.static": 0.020144,
            "friction.viscous": 0.1667061,
            "friction.reverse.static": 0.0206277,
            "friction.reverse.viscous": 0.2404236,
            "disturbance.kind": "sine",
            "disturbance.amplitude": 60.0,
            "rate": 1000.0,
            "pace": "lockstep",
            "duration": 10.0,
        },
        "velocity_feedback_controller": {
            "position_gain": -1370728.4554,  # 243.45 V/(m/s) 160.18 1/s 35.15065 N/V
            "velocity_gain": -8557.426,
            "force_limit": 351.5065,  # 10 V
        },
    },
}


@pytest.mark.parametrize("name", SHIPPED)
def test_the_shipped_scenarios_are_complete(name: str) -> None:
    assert load_scenario(name).left_to_defaults == []


@pytest.mark.parametrize("name", SHIPPED)
def test_numbers_of_the_shipped_scenarios(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.overrides == ()
    for node, expected in SHIPPED[name].items():
        values = scenario.as_dict()[node]
        assert {parameter: values[parameter] for parameter in expected} == expected


def leaves(tree: Any) -> Iterator[Any]:
    below = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    if not below:
        yield tree
    for each in below:
        yield from leaves(each)


def test_numbers_in_yaml_are_numbers_to_pyyaml_which_ros2_param_load_reads_them_with() -> None:
    texts = [file.read_text() for file in CONFIG.glob("*.yaml")]
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        texts += re.findall(r"^```yaml$(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
    assert len(texts) > len(SHIPPED)
    extremes = {"a": 1e-30, "b": 1e16, "c": float("inf"), "d": -1e6, "e": 5e-324}
    texts.append(parameter_file({"plant": extremes}))
    found = [leaf for text in texts for leaf in leaves(yaml.safe_load(text))]
    assert not [leaf for leaf in found if isinstance(leaf, str) and number_in(leaf) is not None]
    assert {leaf for leaf in found if isinstance(leaf, float)} >= set(extremes.values())


def test_no_other_scenarios_are_shipped() -> None:
    assert {path.stem for path in CONFIG.glob("*.yaml")} == set(SHIPPED)


def test_the_defaults_are_those_of_the_paper() -> None:
    for law in CONTROLLER_PARAMETERS:
        scenario = load_scenario("paper", controller=law)
        for node in scenario.nodes:
            assert getattr(scenario, node) == NODE_PARAMETERS[node]()


@pytest.mark.parametrize("name", SHIPPED)
def test_a_scenario_is_found_by_its_path_too(name: str) -> None:
    assert load_scenario(str(CONFIG / f"{name}.yaml")) == load_scenario(name)


def test_the_drive_and_the_controller_of_a_scenario() -> None:
    scenario = load_scenario("feed_drive")
    drive, washout = scenario.plant.as_drive(), scenario.washout_controller.as_law()
    assert (drive.mass, drive.damping, drive.stiffness) == (100.0, 200.0, 1e6)
    assert (drive.normal_force, drive.belt_speed) == (1000.0, 0.04)
    assert vars(drive.friction) == {"static": 0.4, "minimum": 0.25, "minimum_speed": 0.05}
    assert (washout.corner_frequency, washout.linear_gain, washout.cubic_gain) == (20.0, -3e3, 0.0)
    assert (washout.force_limit, washout.start_after) == (float("inf"), 5.0)


def test_a_scenario_is_found_in_an_installation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "share/stickslip_ros/config"
    folder.mkdir(parents=True)
    (folder / "own.yaml").write_text("/**/plant: {ros__parameters: {mass: 7}}")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    assert load_scenario("own").plant.mass == 7.0
