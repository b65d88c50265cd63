"""Which controller a scenario uses, and its parameters."""

import pickle
from itertools import permutations
from pathlib import Path

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import VelocityFeedback
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS
from stickslip_ros.studies.plan import Axis
from stickslip_ros.studies.study import sweep_study
from tests.scenarios.files import refusal, scenario_file, section

BASE = section("/**/scenario", "{base: feed_drive}")
FEEDBACK = section("/**/velocity_feedback_controller", "{velocity_gain: -3000.0}")
WASHOUT = section("/**/washout_controller", "{linear_gain: -2000.0}")


def test_the_nearest_section_of_a_controller_chooses_it(tmp_path: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, BASE + FEEDBACK))
    assert scenario.control_law == VelocityFeedback(-3000.0)
    assert scenario.nodes == ("plant", "velocity_feedback_controller", "analyzer")
    assert list(scenario.as_dict()) == [*scenario.nodes]
    for text in (BASE, section("/**/plant", "{mass: 2.0}")):
        path = scenario_file(tmp_path, text)
        assert load_scenario(path).controller.law == "washout"
        assert load_scenario(path, ["plant.expects_control=false"]).control_law is None


def test_its_name_may_have_any_namespace_that_applies(tmp_path: Path) -> None:
    for pattern in ("/feed_drive/", "/*/", "/**/"):
        name = f"{pattern}velocity_feedback_controller"
        path = scenario_file(tmp_path, BASE + section(name, "{velocity_gain: -1.0}"))
        assert load_scenario(path).controller.law == "velocity_feedback"
    elsewhere = scenario_file(
        tmp_path, BASE + section("/other/velocity_feedback_controller", "{a: 1}")
    )
    assert load_scenario(elsewhere, other_nodes=True).controller.law == "washout"


def test_a_pattern_for_all_nodes_chooses_none(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, section("/**", "{force_limit: 5.0}"))
    scenario = load_scenario(path)
    assert scenario.controller.law == "washout"
    assert scenario.controller.control_law.force_limit == 5.0
    assert scenario.given == {"washout_controller.force_limit"}
    assert "force_limit" in repr(scenario)
    assert scenario.with_controller("velocity_feedback").controller.control_law.force_limit == 5.0


def test_sections_of_two_controllers_need_a_choice(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, BASE + FEEDBACK + WASHOUT)
    assert "washout_controller and velocity_feedback_controller" in refusal(path)
    for law, gain in (("washout", -2000.0), ("velocity_feedback", -3000.0)):
        scenario = load_scenario(path, controller=law)
        assert scenario.controller.law == law
        values = scenario.as_dict()[f"{law}_controller"]
        assert gain in values.values()


def test_another_controller_takes_its_values_of_the_file(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, BASE + FEEDBACK + WASHOUT)
    scenario = load_scenario(path, ["washout_controller.cubic_gain=-7"], controller="washout")
    other = scenario.with_controller("velocity_feedback")
    assert other.control_law == VelocityFeedback(-3000.0)
    assert other.overrides == ()
    back = other.with_controller("washout")
    assert back.control_law == scenario.control_law
    assert scenario.with_controller("washout") is scenario


def test_the_parameters_are_an_attribute_by_the_name_of_the_node() -> None:
    for law, other in permutations(CONTROLLER_PARAMETERS, 2):
        scenario = load_scenario("feed_drive", controller=law)
        assert getattr(scenario, f"{law}_controller") is scenario.controller
        assert not hasattr(scenario, f"{other}_controller")
        assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_what_is_no_law_or_not_in_use_is_refused() -> None:
    for name, message in (
        ("washuot", "unknown control law washuot; did you mean washout?"),
        ("fuzzy", "the known names are washout, velocity_feedback"),
    ):
        with pytest.raises(InvalidInputError, match=message.replace("?", r"\?")):
            load_scenario("feed_drive", controller=name)
    assert refusal("feed_drive", "velocity_feedback_controller.velocity_gain=-3") == (
        "velocity_feedback_controller: is not the controller in use, which is washout_controller"
    )
    axis = Axis("velocity_feedback_controller.velocity_gain", -2.0, -1.0, 2)
    with pytest.raises(InvalidInputError, match="is not the controller in use"):
        sweep_study(load_scenario("feed_drive"), [axis])


def test_unknown_parameters_of_a_controller_not_in_use_are_refused(tmp_path: Path) -> None:
    wrong = section("/**/velocity_feedback_controller", "{velocity_gian: -1.0}")
    path = scenario_file(tmp_path, BASE + WASHOUT + wrong)
    with pytest.raises(InvalidInputError, match="velocity_gian"):
        load_scenario(path, controller="washout")


def test_the_force_limit_follows_another_law(tmp_path: Path) -> None:
    limited = section("/**/washout_controller", "{force_limit: 120.0}")
    path = scenario_file(tmp_path, BASE + limited)
    scenario = load_scenario(path)
    for other in (
        load_scenario(path, controller="velocity_feedback"),
        scenario.with_controller("velocity_feedback"),
    ):
        assert other.controller.control_law.force_limit == 120.0
        name = "velocity_feedback_controller.force_limit"
        assert name in other.given
        assert name not in other.left_to_defaults
    own = BASE + limited + section("/**/velocity_feedback_controller", "{force_limit: 30.0}")
    other = load_scenario(scenario_file(tmp_path, own), controller="velocity_feedback")
    assert other.controller.control_law.force_limit == 30.0
