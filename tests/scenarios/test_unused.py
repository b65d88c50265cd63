"""Parameters that the chosen law or setting does not use."""

from pathlib import Path

from stickslip_ros.scenarios.files import load_scenario, shipped_scenarios
from stickslip_ros.scenarios.parameters import PlantParameters
from stickslip_ros.scenarios.signal_parameters import ReferenceParameters
from stickslip_ros.scenarios.template import commented_file
from tests.scenarios.files import refusal, scenario_file, section

VISCOUS = "by the law stribeck; laws that use it: coulomb, exponential, stiction"
KINDS = "by the kind none; kinds that use it: "
CASES = {
    "plant.friction.viscous=5": VISCOUS,
    "plant.friction.reverse.viscous=5": VISCOUS,
    "plant.friction.file=curve.csv": "by the law stribeck; laws that use it: table",
    "plant.belt.frequency=3": f"{KINDS}sine, trapezoid",
    "plant.load.amplitude=1": f"{KINDS}step, impulse, ramp, sine, trapezoid",
    "plant.disturbance.file=course.csv": f"{KINDS}table",
    "plant.sensor.difference_samples=3": "by the velocity exact; difference uses it",
}


def test_what_is_named_and_not_used_is_refused() -> None:
    for override, reason in CASES.items():
        name = override.partition("=")[0]
        assert refusal("feed_drive", override) == f"{name} is not used {reason}"


def test_the_choice_in_the_same_call_counts() -> None:
    for overrides, user in (
        (("friction.law=lugre", "friction.slope=1"), "law lugre with the curve exponential;"),
        (("disturbance.kind=impulse", "disturbance.duration=1"), "step, ramp, sine, trapezoid"),
        (("pace=lockstep", "real_time_factor=2"), "realtime uses it"),
    ):
        assert user in refusal("feed_drive", *(f"plant.{override}" for override in overrides))


def test_what_is_used_or_a_default_or_of_the_file_is_taken() -> None:
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


def test_without_control_the_controller_has_no_parameters() -> None:
    message = refusal("paper", "plant.expects_control=no", "washout_controller.linear_gain=-5")
    assert message == (
        "washout_controller.linear_gain is not used with plant.expects_control = False"
    )


def test_a_reference_of_a_step_has_no_frequency() -> None:
    reference = ReferenceParameters().changed({"kind": "step", "frequency": 2.0}, "a node")
    assert reference.unused() == {
        "frequency": "frequency is not used by the kind step; kinds that use it: sine, trapezoid"
    }


def test_what_the_own_law_of_a_file_does_not_use_is_refused(tmp_path: Path) -> None:
    own = section("/**/plant", "{friction: {law: stribeck, viscous: 5.0, slope: 0.45}}")
    path = scenario_file(tmp_path, own)
    assert refusal(path) == f"{path}: plant.friction.viscous is not used {VISCOUS}"
    base = section("/**/scenario", "{base: feed_drive}")
    other = section("/**/plant", "{friction: {law: coulomb}}")
    load_scenario(scenario_file(tmp_path, base + other))


def test_a_complete_file_is_taken_whatever_its_law_does_not_use(tmp_path: Path) -> None:
    scenarios = [load_scenario(name) for name in shipped_scenarios()]
    laws = ("coulomb", "linear", "lugre")
    scenarios += [load_scenario("feed_drive", [f"plant.friction.law={law}"]) for law in laws]
    for scenario in scenarios:
        path = scenario_file(tmp_path, commented_file(scenario, "A copy."))
        read = load_scenario(path, controller=scenario.controller.law)
        assert read.plant.as_drive() == scenario.plant.as_drive()


def test_older_values_are_read() -> None:
    values = {**PlantParameters().flat(), "friction.viscous": 5.0, "belt.frequency": 3.0}
    assert PlantParameters().changed(values, "a bag").friction.viscous == 5.0
