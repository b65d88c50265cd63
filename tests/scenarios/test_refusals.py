"""Files and overrides that are refused, in a line that says why, and their like that are taken."""

from pathlib import Path

import pytest

from stickslip_ros.scenarios.files import load_scenario, shipped_scenarios
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.scenarios.signal_parameters import ReferenceParameters
from stickslip_ros.scenarios.template import commented_file
from tests.scenarios.files import refusal, scenario_file, section

VISCOUS = "is not used by the law stribeck; laws that use it: coulomb, exponential, stiction"
KINDS = "is not used by the kind none; kinds that use it: "
LIFTS = "must leave a normal force of at least 0 N, with normal_force = 1.0 N"
FORM = ": must be NODE.PARAMETER=VALUE; "
NO_YAML = ": is not YAML for ROS: "

FILES = [
    *(
        (text, ", line ", NO_YAML)
        for text in ("{", "a: [b", "\t- a", "? [a]\n: 1", '"', "a: [b, 1]")
    ),
    ("plant", "found 'plant' at the top"),
    ("- plant", "found ['plant'] at the top"),
    ("", "expected node names with ros__parameters below"),
    ("# nothing but a comment", "expected node names with ros__parameters below"),
    ("a: b", "found 'b' at a"),
    ("/**/plant: {}", "at /**/plant"),
    ("/**/plant:\n  ros__parameters:", f"line 2{NO_YAML}a value is missing"),
    ("/**/plant:\n  ros__parameters: [1]", "ros__parameters must be names and values"),
    ("/**/plant: &again\n  ros__parameters: *again\n", "aliases are not supported"),
    (
        section("/**", "{masss: 1}"),
        "section /**: no node has a parameter masss; did you mean mass?",
    ),
]
"""Texts of files, and what is said of them after the path."""

PARAMETERS = [
    (
        "{friction.law: rate_state, friction.direct_effect: 0.01}",
        "friction.law = 'rate_state' is invalid: the last versions that had this law are those of "
        "0.2.0 before its release",
    ),
    ("{friction: {static: 0.1}}", "minimum = 0.25", "static = 0.1"),
    ("{friction: {law: exponential, kinetic: 0.5}}", "kinetic = 0.5", "static = 0.4"),
    ("{force_delay: 5e3, force_jitter: 6e3}", "force_jitter = 6000.0 s", "1e6 periods"),
    ("{friction: {statik: 0.4}}", "unknown parameter friction.statik = 0.4; did you mean fric"),
    ("{mass: {kg: 1}}", "unknown parameter mass.kg = 1; did you mean mass?"),
    ("{1: a}", "unknown parameter 1 = 'a'; known are actuator.*, answer_every, autostart,"),
]
"""Parameters of the plant in a file, and what is said of them."""

OVERRIDES = [
    *((override, f"{override}{FORM}") for override in ("plant.mass", "mass=1", "plant=1", "=", "")),
    ("plant.=1", f"plant.=1{FORM}"),
    ("belt_speed=1", FORM, "; did you mean plant.belt_speed?"),
    ("motor.mass=1", "motor.mass=1", "unknown node motor", "washout_controller"),
    ("plant.mass=[", "plant.mass=[", "not YAML"),
    ("plant.beltspeed=1", "parameter beltspeed; did you mean plant.belt_speed?"),
    ("plant.colour=1", "parameter colour; plant has actuator.limit,"),
    ("plant.mass=", "plant.mass=", "plant: mass = None", "a finite number above 0 kg"),
    ("plant.belt_speed=fast", "plant: belt_speed = 'fast'", "in m/s, not text"),
    ("plant.friction=coulomb", "unknown parameter friction; did you mean plant."),
    ("plant.friction.static=0.2", "minimum = 0.25"),
    ("plant.sensor.difference_samples=301", "a whole number at least 1 and at most 300"),
    (
        "plant.sensor.velocity=difference plant.sensor.velocity_noise=0.1",
        "sensor.velocity_noise = 0.1 m/s must be 0",
    ),
    ("plant.load.kind=step plant.load.amplitude=-1.5", "load.amplitude = ", LIFTS),
    (
        "plant.load.kind=ramp plant.load.amplitude=-1.5 plant.load.duration=2",
        "load.amplitude = ", LIFTS,
    ),
    ("plant.load.kind=sine plant.load.amplitude=1.01", "load.amplitude = ", LIFTS),
    (
        "plant.load.kind=sine plant.load.amplitude=-1.01 plant.load.frequency=0.1",
        "load.amplitude = ", LIFTS,
    ),
    (
        "plant.load.kind=trapezoid plant.load.amplitude=-1.5 plant.load.duration=9",
        "load.amplitude = ", LIFTS,
    ),
]  # fmt: skip
"""Overrides of `paper`, and what is said of them."""

UNUSED = {
    "plant.friction.viscous=5": f"plant.friction.viscous {VISCOUS}",
    "plant.friction.reverse.viscous=5": f"plant.friction.reverse.viscous {VISCOUS}",
    "plant.friction.file=curve.csv": "is not used by the law stribeck; laws that use it: table",
    "plant.belt.frequency=3": f"plant.belt.frequency {KINDS}sine, trapezoid",
    "plant.load.amplitude=1": f"plant.load.amplitude {KINDS}step, impulse, ramp, sine, trapezoid",
    "plant.disturbance.file=course.csv": f"plant.disturbance.file {KINDS}table",
    "plant.sensor.difference_samples=3": "is not used by the velocity exact; difference uses it",
    # The choice in the same call counts.
    "plant.friction.law=lugre plant.friction.slope=1": "law lugre with the curve exponential;",
    "plant.disturbance.kind=impulse plant.disturbance.duration=1": "step, ramp, sine, trapezoid",
    "plant.pace=lockstep plant.real_time_factor=2": "realtime uses it",
    "plant.expects_control=no washout_controller.linear_gain=-5": (
        "washout_controller.linear_gain is not used with plant.expects_control = False"
    ),
}
"""Overrides of `feed_drive` that its law or setting does not use."""


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


def test_a_bad_file_is_refused_with_its_path(tmp_path: Path) -> None:
    for text, *fragments in FILES:
        path = scenario_file(tmp_path, text)
        message = refusal(path)
        assert message.startswith(path)
        assert all(fragment in message for fragment in fragments), text
    for text, *fragments in PARAMETERS:
        path = scenario_file(tmp_path, section("/**/plant", text))
        message = refusal(path)
        assert message.startswith(f"{path}, plant: ")
        assert all(fragment in message for fragment in fragments), text


def test_an_override_does_not_mend_a_bad_file(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, section("/**/plant", "{mass: -1}"))
    message = refusal(path, "plant.mass=1")
    assert "-p" not in message
    assert f"{path}, plant: mass = -1 is invalid" in message


def test_a_bad_override_is_refused() -> None:
    for overrides, *fragments in OVERRIDES:
        message = refusal("paper", *(overrides.split(" ")), "plant.damping=0.1")
        assert all(fragment in message for fragment in fragments), overrides


def test_what_is_named_and_not_used_is_refused(tmp_path: Path) -> None:
    for overrides, reason in UNUSED.items():
        assert reason in refusal("feed_drive", *overrides.split())
    text = section("/**/plant", "{friction: {law: stribeck, viscous: 5.0, slope: 0.45}}")
    path = scenario_file(tmp_path, text)
    assert refusal(path) == f"{path}: plant.friction.viscous {VISCOUS}"
    reference = ReferenceParameters().changed({"kind": "step", "frequency": 2.0}, "a node")
    assert reference.unused() == {
        "frequency": "frequency is not used by the kind step; kinds that use it: sine, trapezoid"
    }


def test_what_is_used_or_a_default_or_of_the_file_is_taken(tmp_path: Path) -> None:
    for overrides in (
        ["friction.viscous=0", "friction.reverse.viscous=.nan"],
        ["friction.viscous=5", "friction.law=coulomb"],
        ["friction.law=lugre", "friction.curve=coulomb", "friction.viscous=0.1"],
        ["friction.law=coulomb"],  # the speed of the file's own law stays
        ["sensor.seed=5", "force_jitter_seed=5", "reply_timeout=5"],
        ["belt.kind=sine", "belt.frequency=3"],
        ["expects_control=false", "force_delay=0.01"],  # of runs with control and without
    ):
        scenario = load_scenario("feed_drive", [f"plant.{override}" for override in overrides])
        again = scenario.overridden(["plant.friction.law=stribeck"])  # leaves the others behind
        assert again.plant.friction.law == "stribeck"
    base = section("/**/scenario", "{base: feed_drive}")
    other = section("/**/plant", "{friction: {law: coulomb}}")
    load_scenario(scenario_file(tmp_path, base + other))
    values = {**PlantParameters().flat(), "friction.viscous": 5.0, "belt.frequency": 3.0}
    assert PlantParameters().changed(values, "a bag").friction.viscous == 5.0


def test_a_complete_file_is_taken_whatever_its_law_does_not_use(tmp_path: Path) -> None:
    scenarios = [load_scenario(name) for name in shipped_scenarios()]
    laws = ("coulomb", "linear", "lugre")
    scenarios += [load_scenario("feed_drive", [f"plant.friction.law={law}"]) for law in laws]
    scenarios.append(load_scenario("paper", ["plant.friction.reverse.static=0.35"]))
    for scenario in scenarios:
        path = scenario_file(tmp_path, commented_file(scenario, "A copy."))
        read = load_scenario(path, controller=scenario.controller.law)
        assert read.plant.as_drive() == scenario.plant.as_drive()


def test_overrides_replace_what_the_file_says() -> None:
    overrides = (
        "plant.mass=3",
        "plant.mass=2",  # the last one counts
        "plant.friction.law=coulomb",
        "plant.publish_truth=no",
        "washout_controller.linear_gain=-1e3",
        "washout_controller.force_limit=.inf",
        "analyzer.bag=here/a=b",
        "analyzer.window=0x10",
        "plant.wait_for=[one, two]",
        "plant.disturbance.kind=sine",
    )
    scenario = load_scenario("feed_drive", overrides)
    plant, control, analyzer = scenario.plant, scenario.washout_controller, scenario.analyzer
    assert scenario.overrides == overrides[1:]
    assert (plant.mass, plant.friction.law, plant.publish_truth) == (2.0, "coulomb", False)
    assert (control.linear_gain, control.force_limit) == (-1000.0, float("inf"))
    assert (analyzer.bag, analyzer.window, plant.wait_for) == ("here/a=b", 16, ["one", "two"])
    assert scenario.as_dict()["plant"]["disturbance.kind"] == "sine"
    assert plant.stiffness == 1e6  # that of the file


def test_overrides_are_checked_together() -> None:
    """A static coefficient of 0.2 alone would be below the smallest kinetic one, 0.25."""
    overrides = ["plant.friction.static=0.2", "plant.friction.minimum=0.1"]
    for texts in (overrides, overrides[::-1]):
        friction = load_scenario("paper", texts).plant.friction
        assert (friction.static, friction.minimum) == (0.2, 0.1)
