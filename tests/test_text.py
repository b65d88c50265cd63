"""Suggestions for unknown names."""

import pytest

from stickslip_ros.text import did_you_mean

KNOWN = ("plant.mass", "plant.rate", "plant.friction.static", "washout_controller.linear_gain")


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("plant.maas", "plant.mass"),
        ("PLANT.MASS", "plant.mass"),
        ("plant.static", "plant.friction.static"),
        ("motor.mass", "plant.mass"),
        ("washout_controller.gain", "washout_controller.linear_gain"),
        ("plant.linear_gain", "washout_controller.linear_gain"),
    ],
)
def test_a_close_name_is_meant(name: str, meant: str) -> None:
    assert did_you_mean(name, KNOWN) == f"did you mean {meant}?"


def test_a_name_with_all_words_of_another_is_not_meant() -> None:
    assert did_you_mean("static", ["a.static", "a.reverse.static"]) == "did you mean a.static?"
    assert did_you_mean("static", ["a_static", "a_reverse_static"]) == "did you mean a_static?"


def test_several_may_be_meant() -> None:
    assert did_you_mean("stop", ["a.stop", "b.stop"]) == "did you mean a.stop or b.stop?"


@pytest.mark.parametrize("name", ["", "plant.", "plant.colour", "x" * 1_000_000])
def test_without_a_close_name_all_known_names_are_listed(name: str) -> None:
    assert did_you_mean(name, KNOWN) == (
        "known are plant.friction.static, plant.mass, plant.rate, washout_controller.linear_gain"
    )
    assert did_you_mean(name, KNOWN, "see there") == "see there"
    assert did_you_mean(name, [], "see there") == "see there"
