from pathlib import Path

from stickslip_ros.scenarios.files import load_scenario
from tests.scenarios.files import refusal, scenario_file, section


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
    assert scenario.overrides == overrides[1:]
    assert scenario.plant.mass == 2.0
    assert scenario.plant.friction.law == "coulomb"
    assert scenario.plant.publish_truth is False
    assert scenario.washout_controller.linear_gain == -1000.0
    assert scenario.washout_controller.force_limit == float("inf")
    assert scenario.analyzer.bag == "here/a=b"
    assert scenario.analyzer.window == 16
    assert scenario.plant.wait_for == ["one", "two"]
    assert scenario.as_dict()["plant"]["disturbance.kind"] == "sine"
    assert scenario.plant.stiffness == 1e6  # that of the file


def test_overrides_are_checked_together() -> None:
    """A static coefficient of 0.2 alone would be below the smallest kinetic one, 0.25."""
    overrides = ["plant.friction.static=0.2", "plant.friction.minimum=0.1"]
    assert "minimum = 0.25" in refusal("paper", overrides[0])
    for texts in (overrides, overrides[::-1]):
        friction = load_scenario("paper", texts).plant.friction
        assert (friction.static, friction.minimum) == (0.2, 0.1)


def test_an_override_does_not_mend_a_bad_file(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, section("/**/plant", "{mass: -1}"))
    message = refusal(path, "plant.mass=1")
    assert "-p" not in message
    assert f"{path}, plant: mass = -1 is invalid" in message


def test_an_override_has_a_form() -> None:
    for override in ("plant.mass", "mass=1", "plant=1", "=", "", "plant.=1"):
        said = refusal("paper", override)
        assert said.startswith(f"{override}: must be NODE.PARAMETER=VALUE; ")
    assert refusal("paper", "belt_speed=1").endswith("; did you mean plant.belt_speed?")


def test_a_bad_override_is_refused() -> None:
    for override, *fragments in (
        ("motor.mass=1", "motor.mass=1", "unknown node motor", "washout_controller"),
        ("plant.mass=[", "plant.mass=[", "not YAML"),
        ("plant.beltspeed=1", "parameter beltspeed; did you mean plant.belt_speed?"),
        ("plant.colour=1", "parameter colour; plant has actuator.limit,"),
        ("plant.mass=", "plant.mass=", "plant: mass = None", "a finite number above 0 kg"),
        ("plant.belt_speed=fast", "plant: belt_speed = 'fast'", "in m/s, not text"),
        ("plant.friction=coulomb", "unknown parameter friction; did you mean plant."),
    ):
        message = refusal("paper", override, "plant.damping=0.1")
        assert all(fragment in message for fragment in fragments)
