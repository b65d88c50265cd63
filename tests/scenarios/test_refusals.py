"""Invalid scenario files, and the messages about them."""

from pathlib import Path

import pytest

from stickslip_ros.scenarios.files import load_scenario, shipped_scenarios
from tests.scenarios.files import refusal, scenario_file, section


def test_what_is_not_there() -> None:
    known = ", ".join(sorted(shipped_scenarios()))
    assert f"unknown scenario 'lathe'; the known names are {known}; " in refusal("lathe")
    assert refusal("papre") == "unknown scenario 'papre'; did you mean paper?"
    for path in ("nowhere.yaml", "./paper", "/nowhere/paper.yaml", "nowhere.yml"):
        assert refusal(path).startswith(f"no scenario file {path}")


def test_a_file_comes_before_what_ships(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert load_scenario("feed_drive.yaml") == load_scenario("feed_drive")
    Path("feed_drive.yaml").write_text(section("/**/plant", "{mass: 7}"), encoding="utf-8")
    assert load_scenario("feed_drive.yaml").plant.mass == 7.0
    assert load_scenario("feed_drive").plant.mass == 100.0


def test_what_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    assert f"cannot read scenario {path}" in refusal(str(path))
    assert str(tmp_path) in refusal(str(tmp_path))


def test_a_file_that_is_no_yaml(tmp_path: Path) -> None:
    for text in ("{", "a: [b", "\t- a", "? [a]\n: 1", '"', "a: [b, 1]"):
        path = scenario_file(tmp_path, text)
        message = refusal(path)
        assert message.startswith(f"{path}, line ")
        assert ": is not YAML for ROS: " in message


def test_a_file_that_is_no_parameter_file(tmp_path: Path) -> None:
    for text, fragment in (
        ("plant", "found 'plant' at the top"),
        ("- plant", "found ['plant'] at the top"),
        ("", "expected node names with ros__parameters below"),
        ("# nothing but a comment", "expected node names with ros__parameters below"),
        ("a: b", "found 'b' at a"),
        ("/**/plant: {}", "at /**/plant"),
        ("/**/plant:\n  ros__parameters:", "line 2: is not YAML for ROS: a value is missing"),
        ("/**/plant:\n  ros__parameters: [1]", "ros__parameters must be names and values"),
        ("/**/plant: &again\n  ros__parameters: *again\n", "aliases are not supported"),
    ):
        path = scenario_file(tmp_path, text)
        message = refusal(path)
        assert message.startswith(path)
        assert fragment in message


def test_a_law_of_earlier_versions_is_named_before_its_constants(tmp_path: Path) -> None:
    path = scenario_file(
        tmp_path, section("/**/plant", "{friction.law: rate_state, friction.direct_effect: 0.01}")
    )
    assert refusal(path) == (
        f"{path}, plant: friction.law = 'rate_state' is invalid: the last versions that had this "
        "law are those of 0.2.0 before its release"
    )


def test_values_that_do_not_go_together(tmp_path: Path) -> None:
    for parameters, *fragments in (
        ("{friction: {static: 0.1}}", "minimum = 0.25", "static = 0.1"),
        ("{friction: {law: exponential, kinetic: 0.5}}", "kinetic = 0.5", "static = 0.4"),
        ("{force_delay: 5e3, force_jitter: 6e3}", "force_jitter = 6000.0 s", "1e6 periods"),
    ):
        path = scenario_file(tmp_path, section("/**/plant", parameters))
        message = refusal(path)
        assert message.startswith(f"{path}, plant: ")
        assert all(fragment in message for fragment in fragments)


def test_a_parameter_that_is_not_known(tmp_path: Path) -> None:
    for parameters, name, value, meant in (
        ("{friction: {statik: 0.4}}", "friction.statik", "0.4", "did you mean friction.static?"),
        ("{mass: {kg: 1}}", "mass.kg", "1", "did you mean mass?"),
        ("{1: a}", "1", "'a'", "known are actuator.*, answer_every, autostart,"),
    ):
        path = scenario_file(tmp_path, section("/**/plant", parameters))
        said = refusal(path)
        assert said.startswith(f"{path}, plant: unknown parameter {name} = {value}; {meant}")
    path = scenario_file(tmp_path, section("/**", "{masss: 1}"))
    assert refusal(path) == (
        f"{path}: section /**: no node has a parameter masss; did you mean mass?"
    )
