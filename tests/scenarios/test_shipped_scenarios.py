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

SHIPPED = [*CONFIG.glob("*.yaml")]


def test_the_shipped_scenarios_are_complete_and_found_by_path_too() -> None:
    for path in SHIPPED:
        scenario = load_scenario(path.stem)
        assert scenario.name == path.stem
        assert scenario.overrides == ()
        assert scenario.left_to_defaults == []
        assert load_scenario(str(path)) == scenario


def leaves(tree: Any) -> Iterator[Any]:
    below = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    if not below:
        yield tree
    for each in below:
        yield from leaves(each)


def test_numbers_in_yaml_are_numbers_to_pyyaml_which_ros2_param_load_reads_them_with() -> None:
    texts = [file.read_text() for file in SHIPPED]
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        texts += re.findall(r"^```yaml$(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
    assert len(texts) > len(SHIPPED)
    extremes = {"a": 1e-30, "b": 1e16, "c": float("inf"), "d": -1e6, "e": 5e-324}
    texts.append(parameter_file({"plant": extremes}))
    found = [leaf for text in texts for leaf in leaves(yaml.safe_load(text))]
    assert not [leaf for leaf in found if isinstance(leaf, str) and number_in(leaf) is not None]
    assert {leaf for leaf in found if isinstance(leaf, float)} >= set(extremes.values())


def test_the_defaults_are_those_of_the_paper() -> None:
    for law in CONTROLLER_PARAMETERS:
        scenario = load_scenario("paper", controller=law)
        for node in scenario.nodes:
            assert getattr(scenario, node) == NODE_PARAMETERS[node]


def test_a_scenario_is_found_in_an_installation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "share/stickslip_ros/config"
    folder.mkdir(parents=True)
    (folder / "own.yaml").write_text("/**/plant: {ros__parameters: {mass: 7}}")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    assert load_scenario("own").plant.mass == 7.0


def test_the_axis_has_the_gains_of_its_drive() -> None:
    """243.45 V/(m/s), 160.18 1/s and 35.15065 N/V, of at most 10 V, and no spring."""
    axis = load_scenario("axis")
    law = axis.controller.control_law
    assert law.velocity_gain == pytest.approx(-243.45 * 35.15065, rel=1e-6)
    assert law.position_gain == pytest.approx(160.18 * law.velocity_gain, rel=1e-6)
    assert (law.force_limit, axis.plant.stiffness) == (pytest.approx(10.0 * 35.15065), 0.0)
