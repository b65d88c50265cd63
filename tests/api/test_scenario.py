"""Scenarios from names, paths, texts and keywords."""

from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.keywords import keyword_of, parameter_of
from stickslip_ros.scenarios.parameter_group import NodeParameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.studies.columns import COLUMNS

EVERY = [f"{node}.{name}" for node, model in NODE_PARAMETERS.items() for name in model.known]
OF_PAPER = load_scenario("paper").nodes
SHIPPED = Path(__file__).parents[2] / "config"
SHARED = set(NodeParameters().known)


def test_a_keyword_is_the_text_that_it_stands_for() -> None:
    by_text = load_scenario(
        "paper",
        [
            *("plant.belt_speed=0.2", "plant.friction.law=linear", "plant.initial.position=0.1"),
            *("analyzer.window=5", "washout_controller.linear_gain=-2", "plant.publish_truth=true"),
        ],
    )
    keywords = {
        "belt_speed": 0.2,
        "friction_law": "linear",
        "initial_position": 0.1,
        "window": 5,
        "linear_gain": -2,
        "publish_truth": True,
    }
    found = ss.scenario("paper", **keywords)
    assert found == by_text
    assert found.given == by_text.given


def test_every_parameter_has_a_keyword_of_its_own_that_takes_its_default() -> None:
    scenarios: dict[str | None, ss.Scenario] = {}
    for parameter in EVERY:
        node, _, name = parameter.partition(".")
        keyword, law = keyword_of(parameter), None
        nodes = OF_PAPER if node in OF_PAPER else ("plant", node, "analyzer")
        assert keyword.isidentifier()
        assert keyword not in COLUMNS
        if keyword in SHARED:
            several = r"several nodes .*; write plant.* or .*analyzer"
            with pytest.raises(InvalidInputError, match=several):
                parameter_of(keyword, nodes)
            continue
        assert parameter_of(keyword, nodes) == parameter
        law = None if node in OF_PAPER else node.removesuffix("_controller")
        if law not in scenarios:
            scenarios[law] = load_scenario("paper", controller=law)
        value = scenarios[law].as_dict()[node][name]
        found = ss.scenario(scenarios[law], **{keyword: value})
        assert found.as_dict() == scenarios[law].as_dict(), parameter


def test_refusals_are_one_sentence() -> None:
    refused: list[tuple[str, object, str]] = [
        ("belt_sped", 0.1, "belt_sped: no node has such a parameter; did you mean belt_speed?"),
        ("static", 0.1, "did you mean friction_static?"),
        ("friction__static", 0.1, "did you mean friction_static?"),
        ("autostart", True, "write plant.autostart or washout_controller.autostart or analyzer."),
        ("belt_speed", "fast", "belt_speed = 'fast' is invalid: must be a finite number"),
        ("belt_speed", (1, 2), "must be a finite number"),
    ]
    for keyword, value, meant in refused:
        with pytest.raises(InvalidInputError) as refusal:
            ss.scenario("paper", **{keyword: value})
        assert meant in str(refusal.value)
        assert "\n" not in str(refusal.value)
    for text in ("a: b", "true", "2.0", "with\nlines 机"):
        assert ss.scenario("paper", bag=text).analyzer.bag == text


def test_numbers_of_numpy_are_numbers() -> None:
    found = ss.scenario("paper", belt_speed=np.float64(0.1), window=np.int64(7), mass=2)
    assert (found.plant.belt_speed, found.analyzer.window, found.plant.mass) == (0.1, 7, 2.0)
    assert found.overrides == ("plant.belt_speed=0.1", "analyzer.window=7", "plant.mass=2")
    limited = ss.scenario("paper", force_limit=float("inf"))
    assert limited.overrides == ("washout_controller.force_limit=inf",)


def test_a_scenario_can_be_changed_again() -> None:
    first = ss.scenario("feed_drive", belt_speed=0.03)
    second = ss.scenario(first, "plant.damping=100", belt_speed=0.02)
    assert second == ss.scenario(
        "feed_drive", "plant.belt_speed=0.03", "plant.damping=100", belt_speed=0.02
    )
    assert first == ss.scenario("feed_drive", belt_speed=0.03)


def test_a_path_and_a_base(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("/**/plant:\n  ros__parameters:\n    damping: 100.0\n")
    found = ss.scenario(file, base="feed_drive")
    assert (found.plant.damping, found.plant.mass) == (100.0, 100.0)
    assert ss.scenario(file, base=SHIPPED / "feed_drive.yaml") == found
    assert ss.scenario(str(file)).plant.mass == 1.0
    with pytest.raises(InvalidInputError, match="mine is loaded, and needs no base"):
        ss.scenario(found, base="paper")


def test_it_prints_as_what_it_is_and_says_what_is_left_to_defaults(tmp_path: Path) -> None:
    found = ss.scenario("feed_drive", belt_speed=0.03)
    lines = repr(found).splitlines()
    assert lines[0] == "scenario feed_drive plant.belt_speed=0.03"
    assert any(line.split() == ["plant.belt_speed", "0.03", "m/s"] for line in lines)
    assert not any("m/s" in line for line in repr(ss.scenario("paper")).splitlines())
    assert "default" not in repr(found)
    assert "<td" in found._repr_html_()  # pyright: ignore
    file = tmp_path / "short.yaml"
    file.write_text("/**/plant:\n  ros__parameters:\n    mass: 2.0\n")
    rows = [line.split() for line in repr(ss.scenario(file)).splitlines()]
    assert ["plant.mass", "2", "kg"] in rows
    assert ["plant.stiffness", "1", "N/m", "default"] in rows


def test_the_controller_is_chosen_and_its_constants_are_keywords() -> None:
    found = ss.scenario("paper", controller="velocity_feedback", velocity_gain=-0.5)
    assert found == load_scenario(
        "paper", ["velocity_feedback_controller.velocity_gain=-0.5"], controller="velocity_feedback"
    )
    assert found.controller.node == "velocity_feedback_controller"
    again = ss.scenario(ss.scenario("paper"), controller="velocity_feedback", velocity_gain=-0.5)
    assert again.as_dict() == found.as_dict()
    assert ss.scenario(again, controller="washout").as_dict() == ss.scenario("paper").as_dict()


def test_a_keyword_of_a_controller_that_is_not_in_use_names_both() -> None:
    with pytest.raises(InvalidInputError) as refused:
        ss.scenario("paper", reset_band=1.0)
    assert str(refused.value) == (
        "reset_band: is a parameter of reset_integral_controller; the controller in use is "
        "washout_controller"
    )
    with pytest.raises(InvalidInputError, match="linear_gain: is a parameter of washout_control"):
        ss.sweep(ss.scenario("paper", controller="velocity_feedback"), linear_gain=(-1.0, 0.0, 2))


def test_none_is_no_control() -> None:
    free = ss.scenario("feed_drive", controller=None)
    assert free == ss.scenario("feed_drive", "plant.expects_control=false")
    assert free.control_law is None
    assert ss.scenario(ss.scenario("feed_drive"), controller=None).control_law is None
    with pytest.raises(InvalidInputError, match="linear_gain is not used with"):
        ss.scenario("feed_drive", controller=None, linear_gain=-5.0)
