"""Invalid scenario files, and the messages about them."""

from pathlib import Path

import pytest

from stickslip_ros.scenarios.files import load_scenario, shipped_scenarios
from tests.scenarios.files import refusal, scenario_file, section


def test_an_unknown_scenario() -> None:
    known = ", ".join(sorted(shipped_scenarios()))
    assert f"unknown scenario 'lathe'; the known names are {known}; " in refusal("lathe")
    assert refusal("papre") == "unknown scenario 'papre'; did you mean paper?"


@pytest.mark.parametrize("path", ["nowhere.yaml", "./paper", "/nowhere/paper.yaml", "nowhere.yml"])
def test_a_file_that_is_not_there(path: str) -> None:
    assert refusal(path).startswith(f"no scenario file {path}")


@pytest.mark.parametrize("name", ["feed_drive", "feed_drive.yaml"])
def test_what_ships_is_found_with_and_without_its_ending(name: str) -> None:
    assert load_scenario(name).name == "feed_drive"


def test_a_file_comes_before_what_ships(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("feed_drive.yaml").write_text(section("/**/plant", "{mass: 7}"), encoding="utf-8")
    assert load_scenario("feed_drive.yaml").plant.mass == 7.0
    assert load_scenario("feed_drive").plant.mass == 100.0


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    assert f"cannot read scenario {path}" in refusal(str(path))


def test_a_directory(tmp_path: Path) -> None:
    assert str(tmp_path) in refusal(str(tmp_path))


@pytest.mark.parametrize("text", ["{", "a: b: c", "\t- a", "? [a]\n: 1", '"', "a: !!python/none x"])
def test_a_file_that_is_no_yaml(tmp_path: Path, text: str) -> None:
    path = scenario_file(tmp_path, text)
    assert refusal(path).startswith(f"{path} is not YAML: ")


@pytest.mark.parametrize(
    ("text", "fragment"),
    [
        ("", "found None at the top"),
        ("# nothing but a comment", "found None at the top"),
        ("plant", "found 'plant' at the top"),
        ("- plant", "found ['plant'] at the top"),
        ("a: b", "found 'b' at /a"),
        ("/**/plant: 5", "found 5 at /**/plant"),
        ("/**/plant: {}", "at /**/plant"),
        ("/**/plant:\n  ros__parameters:", "/**/plant: ros__parameters must be names and values"),
        ("/**/plant:\n  ros__parameters: [1]", "ros__parameters must be names and values"),
    ],
)
def test_a_file_that_is_no_parameter_file(tmp_path: Path, text: str, fragment: str) -> None:
    path = scenario_file(tmp_path, text)
    message = refusal(path)
    assert message.startswith(f"{path}: ")
    assert fragment in message


def test_a_file_that_contains_itself(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, "/**/plant: &again\n  ros__parameters: *again\n")
    assert path in refusal(path)


FINITE = "must be a finite number"
POSITIVE = f"{FINITE} above 0"
WHOLE = "must be a whole number"


@pytest.mark.parametrize(
    ("node", "parameter", "value", "shown", "allowed"),
    [
        # Bounds.
        ("plant", "mass", "0", "0", f"{POSITIVE} kg"),
        ("plant", "mass", "-1.5", "-1.5", f"{POSITIVE} kg"),
        ("plant", "damping", "-1e-9", "-1e-09", f"{FINITE} at least 0 N s/m"),
        ("plant", "stiffness", "-1.0", "-1.0", f"{FINITE} at least 0 N/m"),
        ("plant", "normal_force", "-1", "-1", f"{POSITIVE} N"),
        ("plant", "friction.static", "-0.1", "-0.1", f"{FINITE} at least 0"),
        ("plant", "friction.minimum_speed", "0", "0", f"{POSITIVE} m/s"),
        ("plant", "friction.decay_speed", "0", "0", f"{POSITIVE} m/s"),
        ("plant", "rate", "0", "0", f"{FINITE} at least 1e-06 and at most 1e+09 Hz"),
        ("plant", "rate", "1.1e9", "1100000000.0", f"{FINITE} at least 1e-06 and at most 1e+09 Hz"),
        ("plant", "real_time_factor", "0", "0", f"{POSITIVE}"),
        ("plant", "force_delay", "-0.1", "-0.1", f"{FINITE} at least 0 s"),
        ("plant", "force_jitter", "-0.1", "-0.1", f"{FINITE} at least 0 s"),
        ("plant", "force_jitter_seed", "-1", "-1", f"{WHOLE} at least 0"),
        ("plant", "reply_timeout", "0", "0", f"{FINITE} at least 0.001 s"),
        ("plant", "flow_window", "199", "199", f"{WHOLE} at least 200 and at most 4000 samples"),
        ("plant", "flow_window", "100001", "100001", f"{WHOLE} at least 200"),
        ("plant", "disturbance.frequency", "0", "0", f"{POSITIVE} and at most 1e+09 Hz"),
        ("plant", "disturbance.start", "-1", "-1", f"{FINITE} at least 0 and at most 1e+09 s"),
        ("washout_controller", "corner_frequency", "0", "0", f"{POSITIVE} rad/s"),
        ("washout_controller", "force_limit", "-1", "-1", "at least 0 N"),
        (
            "washout_controller",
            "start_after",
            "-1",
            "-1",
            f"{FINITE} at least 0 s",
        ),
        ("analyzer", "window", "0", "0", f"{WHOLE} at least 1 and at most 100000 cycles"),
        ("analyzer", "flush_period", "0", "0", f"{FINITE} at least 0.001 s"),
        # Limits that only a mistake meets.
        ("plant", "mass", "1e31", "1e+31", f"{FINITE} at least 1e-30 and at most 1e+30 kg"),
        ("plant", "mass", "1e-31", "1e-31", f"{FINITE} at least 1e-30 and at most 1e+30 kg"),
        ("plant", "belt_speed", "-1e31", "-1e+31", "at least -1e+30 and at most 1e+30 m/s"),
        # Choices.
        ("plant", "pace", "fast", "'fast'", "must be one of realtime, lockstep"),
        ("plant", "friction.law", "dry", "'dry'", "one of stribeck, coulomb, linear, exponential"),
        (
            "plant",
            "disturbance.kind",
            "on",
            "True",
            "must be one of none, step, impulse, ramp, sine",
        ),
        ("analyzer", "compression", "zip", "'zip'", "must be one of lz4, zstd, none"),
        # Not finite.
        ("plant", "mass", ".nan", "nan", f"{POSITIVE} kg"),
        ("plant", "mass", ".inf", "inf", f"{POSITIVE} kg"),
        ("plant", "belt_speed", ".nan", "nan", f"{FINITE} in m/s"),
        ("plant", "belt_speed", "-.inf", "-inf", f"{FINITE} in m/s"),
        ("plant", "duration", ".nan", "nan", "at least 0 s"),
        ("plant", "disturbance.duration", ".nan", "nan", "at least 0 s"),
        (
            "washout_controller",
            "linear_gain",
            ".nan",
            "nan",
            f"{FINITE} in N s/m",
        ),
        ("washout_controller", "force_limit", ".nan", "nan", "at least 0 N"),
        (
            "washout_controller",
            "start_after",
            ".inf",
            "inf",
            f"{FINITE} at least 0 s",
        ),
        # Types.
        ("plant", "mass", "yes", "True", f"{POSITIVE} kg"),
        ("plant", "mass", "'1'", "'1'", f"{POSITIVE} kg"),
        ("plant", "mass", "[1.0]", "[1.0]", f"{POSITIVE} kg"),
        ("plant", "mass", "~", "None", f"{POSITIVE} kg"),
        ("plant", "expects_control", "1", "1", "must be true or false"),
        ("plant", "autostart", "'true'", "'true'", "must be true or false"),
        ("plant", "wait_for", "analyzer", "'analyzer'", "must be a list of strings"),
        ("plant", "wait_for", "[1]", "[1]", "must be a list of strings"),
        ("plant", "pace", "1", "1", "must be one of realtime, lockstep"),
        ("analyzer", "window", "20.0", "20.0", WHOLE),
        ("analyzer", "bag", "1", "1", "must be a string"),
    ],
)
def test_a_value_that_is_not_allowed(
    tmp_path: Path, node: str, parameter: str, value: str, shown: str, allowed: str
) -> None:
    path = scenario_file(tmp_path, section(f"/**/{node}", f"{{{parameter}: {value}}}"))
    message = refusal(path)
    assert message.startswith(f"{path}, {node}: {parameter} = {shown} is refused: must be ")
    assert allowed in message


def test_every_bad_value_is_named(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, section("/**/plant", "{mass: 0, damping: -1, rate: 10}"))
    message = refusal(path)
    assert "mass = 0 " in message
    assert "damping = -1 " in message
    assert "rate" not in message


@pytest.mark.parametrize(
    ("parameters", "fragments"),
    [
        ("{friction: {static: 0.1}}", ["minimum = 0.25", "static = 0.1"]),
        ("{friction.minimum: 0.5}", ["minimum = 0.5", "static = 0.4"]),
        ("{friction: {law: exponential, kinetic: 0.5}}", ["kinetic = 0.5", "static = 0.4"]),
        ("{force_delay: 1e5, rate: 11}", ["force_delay = 100000.0 s", "1e6 periods of rate"]),
        ("{force_delay: 5e3, force_jitter: 6e3}", ["force_jitter = 6000.0 s", "1e6 periods"]),
    ],
)
def test_values_that_do_not_go_together(
    tmp_path: Path, parameters: str, fragments: list[str]
) -> None:
    path = scenario_file(tmp_path, section("/**/plant", parameters))
    message = refusal(path)
    assert message.startswith(f"{path}, plant: ")
    for fragment in fragments:
        assert fragment in message


@pytest.mark.parametrize(
    ("parameters", "name", "value", "meant"),
    [
        ("{masss: 1}", "masss", "1", "did you mean mass?"),
        ("{friction.statik: 0.4}", "friction.statik", "0.4", "did you mean friction.static?"),
        ("{friction: {statik: 0.4}}", "friction.statik", "0.4", "did you mean friction.static?"),
        ("{friction: 0.4}", "friction", "0.4", "did you mean friction."),
        ("{mass: {kg: 1}}", "mass.kg", "1", "did you mean mass?"),
        ("{linear_gain: -1.0}", "linear_gain", "-1.0", "known are actuator.*, autostart,"),
        ("{1: a}", "1", "'a'", "known are actuator.*, autostart,"),
    ],
)
def test_a_parameter_that_is_not_known(
    tmp_path: Path, parameters: str, name: str, value: str, meant: str
) -> None:
    path = scenario_file(tmp_path, section("/**/plant", parameters))
    message = refusal(path)
    assert message.startswith(f"{path}, plant: unknown parameter {name} = {value}; {meant}")


def test_a_parameter_of_no_node(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, section("/**", "{masss: 1}"))
    assert refusal(path) == (
        f"{path}: section /**: no node has a parameter masss; did you mean mass?"
    )
