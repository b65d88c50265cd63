"""The nodes to which the sections of a file apply, as in ROS, and what completes a file."""

from pathlib import Path

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from tests.scenarios.conftest import ReadByRos
from tests.scenarios.files import refusal, scenario_file, section

# By namespace: patterns that match its plant, and that do not.
MATCHES = {
    "/feed_drive": (
        ["/**", "/**/plant", "/*/plant", "/feed_drive/plant", "/feed_drive/*", "/*/*", "/**/*",
         "/feed_drive/**", "/**/feed_drive/plant", "feed_drive/plant", "**/plant",
         "/feed_drive/**/plant", "/**/**/plant"],
        ["plant", "/plant", "/*", "/*/*/plant", "/other/plant", "/feed_drive/*/plant"],
    ),
    "/a/b": (
        ["/**", "/**/plant", "/a/b/plant", "/*/*/plant", "/a/*/plant", "/a/**/plant",
         "/**/b/plant"],
        ["plant", "/*/plant", "/b/plant", "/a/plant"],
    ),
    "/": (
        ["/**", "/**/plant", "/plant", "plant", "/*", "**"],
        ["/*/plant", "/feed_drive/plant"],
    ),
}  # fmt: skip
matching = [(namespace, p) for namespace, (these, _) in MATCHES.items() for p in these]
not_matching = [(namespace, p) for namespace, (_, others) in MATCHES.items() for p in others]


def test_a_section_applies_to_the_nodes_that_it_matches_for_ros_too(
    tmp_path: Path, read_by_ros: ReadByRos
) -> None:
    for namespace, pattern in matching:
        path = scenario_file(tmp_path, section(pattern, "{mass: 7.0}"))
        assert load_scenario(path, namespace=namespace).plant.mass == 7.0
        assert read_by_ros(path, namespace) == {"mass": 7.0}, (namespace, pattern)
    for namespace, pattern in not_matching:
        path = scenario_file(tmp_path, section(pattern, "{mass: 7.0}"))
        assert read_by_ros(path, namespace) == {}, (namespace, pattern)
        message = refusal(path, namespace=namespace)
        assert message.startswith(f"{path}: section /{pattern.strip('/')} matches no node")
        assert f"the nodes in namespace {namespace} are {', '.join(NODE_PARAMETERS)}" in message


def test_sections_of_other_nodes_are_left_alone_where_there_may_be_some(tmp_path: Path) -> None:
    text = section("/**/plant", "{mass: 7.0}") + section("/**/damper", "{gain: 0.5}")
    scenario = load_scenario(scenario_file(tmp_path, text), other_nodes=True)
    assert (scenario.plant.mass, scenario.other_sections) == (7.0, ("/**/damper",))
    assert str(scenario.path) == str(tmp_path / "scenario.yaml")


PLANT = section("/**/plant", "{mass: 80.0, friction: {static: 0.5}}")
BASE = section("/**/scenario", "{base: feed_drive}")


def write(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_the_section_names_what_completes_the_file(tmp_path: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, BASE + PLANT), ["plant.damping=3"])
    plant, shipped = scenario.plant, load_scenario("feed_drive")
    assert (plant.mass, plant.friction.static, plant.damping) == (80.0, 0.5, 3.0)
    assert (plant.stiffness, plant.friction.minimum_speed) == (1e6, 0.05)
    assert scenario.washout_controller == shipped.washout_controller
    assert scenario.name == "scenario"
    assert scenario.left_to_defaults == []


def test_an_argument_takes_the_place_of_the_section(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, BASE + PLANT)
    assert load_scenario(path, base="paper").plant.stiffness == 1.0
    assert load_scenario(scenario_file(tmp_path, PLANT), base="feed_drive").plant.stiffness == 1e6


def test_a_base_may_lie_beside_the_file_and_have_one_itself(tmp_path: Path) -> None:
    write(tmp_path / "mine.yaml", BASE + PLANT)
    text = section("/**/scenario", "{base: mine.yaml}") + section("/**/plant", "{damping: 7.0}")
    plant = load_scenario(write(tmp_path / "other.yaml", text)).plant
    assert (plant.damping, plant.mass, plant.stiffness) == (7.0, 80.0, 1e6)


def test_a_base_that_leads_back_is_refused(tmp_path: Path) -> None:
    for one, other in (("one", "other"), ("other", "one")):
        write(tmp_path / f"{one}.yaml", section("/**/scenario", f"{{base: {other}.yaml}}"))
    message = refusal(str(tmp_path / "one.yaml"))
    assert message.endswith("one.yaml leads back to itself")


def test_a_bad_base_is_refused(tmp_path: Path) -> None:
    for parameters, fragment in (
        ("{base: feed_driv}", "base: unknown scenario 'feed_driv'; did you mean feed_drive?"),
        ("{base: nowhere.yaml}", "base: no scenario file nowhere.yaml"),
        ("{base: 5}", "{'base': 5} is invalid: must be base, the name or the path of a scenario"),
        ('{base: ""}', "{'base': ''} is invalid"),
        ("{}", "{} is invalid"),
        ("{basis: paper}", "{'basis': 'paper'} is invalid: must be base"),
    ):
        path = scenario_file(tmp_path, section("/**/scenario", parameters) + PLANT)
        message = refusal(path)
        assert path in message
        assert fragment in message
    with pytest.raises(InvalidInputError, match="did you mean feed_drive"):
        load_scenario(scenario_file(tmp_path, PLANT), base="feed_driv")


def test_a_section_of_another_namespace_is_no_base(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, section("/other/scenario", "{base: feed_drive}") + PLANT)
    assert "section /other/scenario matches no node" in refusal(path)


def test_ros_reads_a_file_that_names_a_base(tmp_path: Path, read_by_ros: ReadByRos) -> None:
    read = read_by_ros(scenario_file(tmp_path, BASE + PLANT))
    assert read == {"mass": 80.0, "friction.static": 0.5}


def test_what_is_left_to_defaults(tmp_path: Path) -> None:
    text = PLANT + section("/**/washout_controller", "{linear_gain: -3000.0}")
    path = scenario_file(tmp_path, text)
    left = load_scenario(path, ["plant.normal_force=5"]).left_to_defaults
    assert left == [
        *(f"plant.{name}" for name in ("damping", "stiffness", "belt_speed", "friction.law")),
        *(f"plant.friction.{name}" for name in ("minimum", "minimum_speed")),
        "plant.rate",
        *(
            f"washout_controller.{name}"
            for name in ("corner_frequency", "cubic_gain", "force_limit", "start_after")
        ),
    ]
    alone = load_scenario(path, ["plant.expects_control=false"]).left_to_defaults
    assert not any(name.startswith("washout_controller") for name in alone)


def test_only_the_constants_of_the_law_in_use_count() -> None:
    scenario = load_scenario("feed_drive", ["plant.friction.law=exponential"])
    assert scenario.left_to_defaults == [
        f"plant.friction.{name}" for name in ("kinetic", "decay_speed", "viscous")
    ]
