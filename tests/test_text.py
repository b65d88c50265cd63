"""Suggestions for unknown names; numbers as text."""

from stickslip_ros.text import did_you_mean, number_in, quantity

KNOWN = ("plant.mass", "plant.rate", "plant.friction.static", "washout_controller.linear_gain")


def test_a_close_name_is_meant() -> None:
    for name, meant in {
        "plant.maas": "plant.mass",
        "PLANT.MASS": "plant.mass",
        "plant.static": "plant.friction.static",
        "motor.mass": "plant.mass",
        "washout_controller.gain": "washout_controller.linear_gain",
        "plant.linear_gain": "washout_controller.linear_gain",
    }.items():
        assert did_you_mean(name, KNOWN) == f"did you mean {meant}?"


def test_a_name_with_all_words_of_another_is_not_meant() -> None:
    assert did_you_mean("static", ["a.static", "a.reverse.static"]) == "did you mean a.static?"
    assert did_you_mean("static", ["a_static", "a_reverse_static"]) == "did you mean a_static?"


def test_several_may_be_meant() -> None:
    assert did_you_mean("stop", ["a.stop", "b.stop"]) == "did you mean a.stop or b.stop?"


def test_without_a_close_name_all_known_names_are_listed() -> None:
    for name in ("", "plant.", "plant.colour", "x" * 1_000_000):
        assert did_you_mean(name, KNOWN) == (
            "known are plant.friction.static, plant.mass, plant.rate, "
            "washout_controller.linear_gain"
        )
        assert did_you_mean(name, KNOWN, "see there") == "see there"
        assert did_you_mean(name, [], "see there") == "see there"


def test_what_is_no_finite_number_counts_as_zero() -> None:
    large = 2**62 + 1
    numbers = {"12": 12, str(large): large, "-3": -3, "1.5e3": 1500.0, "٣": 3, "²": 0}
    numbers |= dict.fromkeys(["", "abc", "nan", "-inf", "1e999", "9" * 400, "9" * 5000], 0)
    for text, number in numbers.items():
        assert number_in(text) == number


def test_a_rate_has_no_prefix() -> None:
    found = [quantity(value, unit) for value in (0.0125, 1234.5) for unit in ("1/s", "m/s")]
    assert found == ["0.0125 1/s", "12.5 mm/s", "1234 1/s", "1.234 km/s"]
