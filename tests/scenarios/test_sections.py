"""The nodes to which the sections of a file apply, as in ROS."""

from pathlib import Path

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


def test_a_section_for_all_gives_to_each_what_it_has(tmp_path: Path) -> None:
    parameters = "{use_sim_time: true, mass: 7.0, window: 5}"
    scenario = load_scenario(scenario_file(tmp_path, section("/**", parameters)))
    assert scenario.plant.use_sim_time
    assert scenario.washout_controller.use_sim_time
    assert scenario.analyzer.use_sim_time
    assert (scenario.plant.mass, scenario.analyzer.window) == (7.0, 5)
