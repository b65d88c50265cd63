"""Numbers with units: what each way in takes, exactness, and what pint must never get to read."""

import sys
from collections.abc import Callable
from contextlib import suppress
from decimal import Decimal
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import stickslip_ros as ss
from stickslip_ros.app.arguments import length, seconds, velocity
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.identify import fixed_of
from stickslip_ros.quantities import number_of
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.keywords import parse_override
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.studies.plan import Axis

MOST = 10_000
"""Characters of a long text."""


def speed_of(override: str) -> float:
    return load_scenario("feed_drive", [override]).plant.belt_speed


def ends(text: str) -> tuple[float, float]:
    axis = Axis.parse(text)
    return axis.first, axis.last


def test_each_way_in_takes_a_unit() -> None:
    ways: list[tuple[Callable[[str], Any], str, Any]] = [
        (speed_of, "plant.belt_speed=30mm/s", 0.03),
        (speed_of, "plant.belt_speed= -1.8 m / min", -0.03),
        (lambda text: ss.scenario("feed_drive", belt_speed=text).plant.belt_speed, "30 mm/s", 0.03),
        (lambda text: parse_override(text)[2], "plant.damping=20 kN s/m", 2e4),
        (ends, "plant.belt_speed=10mm/s:0.03:5", (0.01, 0.03)),
        (ends, "plant.belt_speed=0.01:30mm/s:5:log", (0.01, 0.03)),
        (lambda text: fixed_of([text])["plant.mass"], "plant.mass=95000g", 95.0),
        (seconds, "5min", 300.0),
        (velocity, "-2mm/s", -0.002),
        (length, "0.5µm", 5e-7),
    ]
    for read, text, expected in ways:
        assert read(text) == expected, text


def test_studies_in_python_take_units() -> None:
    drive = ss.scenario("paper", expects_control=False)
    found = ss.sweep(drive, belt_speed=["200mm/s", 0.3], transient=1)
    assert found.study.plan.axes[0].values().tolist() == [0.2, 0.3]
    assert ss.simulate("feed_drive", duration="10ms").duration == 0.01


def test_units_are_converted() -> None:
    for text, unit, expected in (
        ("0.5um", "m", 5e-7),
        ("0.5μm", "m", 5e-7),
        ("3 1/s", "Hz", 3.0),
        ("3/s", "Hz", 3.0),
        ("1e-3 kN/(mm s)", "N/(m s)", 1e3),
        ("2 N s³/mm^3", "N s^3/m^3", 2e9),
        ("20 N·s/m", "N s/m", 20.0),
        ("1 inch", "m", 0.0254),
        ("180 deg/s", "rad/s", 3.141592653589793),
        ("0mm", "m", 0.0),
    ):
        assert number_of("x", text, unit) == expected, text


NUMBER = r"[-+]?([0-9]{1,20}\.?[0-9]{0,20}|\.[0-9]{1,20})([eE][-+]?[0-9]{1,2})?"


@given(
    st.from_regex(NUMBER, fullmatch=True),
    st.sampled_from([("mm", -3), ("um", -6), ("nm", -9), ("km", 3), ("m", 0)]),
)
def test_the_result_is_the_nearest_number(text: str, prefix: tuple[str, int]) -> None:
    """As if the user had moved the decimal point: a product with 1e-3 would round twice."""
    name, power = prefix
    expected = float(Decimal(text).scaleb(power))
    assert number_of("x", f"{text} {name}", "m") == expected


@given(st.floats())
def test_a_plain_number_is_as_before_and_loads_no_pint(value: float) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "pint", None)  # importing it fails
        assert repr(number_of("x", repr(value), "m")) == repr(value)


def test_each_unit_of_a_parameter_converts_to_itself() -> None:
    for model in NODE_PARAMETERS.values():
        for name, parameter in model.known.items():
            if parameter.kind is float and parameter.unit:
                assert number_of(name, f"3 {parameter.unit}", parameter.unit) == 3.0


REFUSED: dict[str | None, list[Any]] = {
    "rad/s": ["5Hz", "5 rpm", "5 1/s"],
    "Hz": ["5 rpm", "5 rad/s"],
    "K": ["20degC"],
    "m/s": ["30kg", "30MM/S", "30 quux", "fast", "", None, "30 mm/s; import os"],
    None: ["3N"],
    "": ["3 rad"],
    "samples": ["3m"],
    "m": [
        *("3dB", "0,5um", "1_0mm", "1e400mm", "1e-400mm", "1e99999999mm", "nan m", "1 (m"),
        *("1**9**9 m", "1 m**999999999", "1 (((m^9)^9)^9)^9", "1 __class__"),
        *("1" * MOST + "mm", "1 " + "m" * MOST, "1 " + "m/" * MOST, "1" + " " * MOST + "mm"),
        "m" * MOST,
    ],
}
"""By the unit that is wanted."""


@pytest.mark.parametrize("unit", REFUSED)
def test_what_does_not_convert_is_refused(unit: str | None) -> None:
    for text in REFUSED[unit]:
        with pytest.raises(InvalidInputError) as caught:
            number_of("plant.x", text, unit)
        message = str(caught.value)
        assert message.startswith("plant.x = ")
        assert str(text)[:70] in message
        assert (unit or "number without a unit") in message
        assert len(message) < 250


UNITS = "m s rad percent degC dB h a rankine neper Hz min mol B M c pH in as"
TERMS = st.tuples(
    st.sampled_from(["", "m", "k", "Y", "milli"]),
    st.sampled_from(UNITS.split(" ")),
    st.sampled_from(["", "^9", "**-9", "²"]),
)


@given(
    st.lists(TERMS.map("".join), min_size=1, max_size=9),
    st.sampled_from(" /*"),
    st.sampled_from(["m", "1", "K", "value"]),
)
def test_pint_fails_in_no_other_way(terms: list[str], join: str, unit: str) -> None:
    with suppress(InvalidInputError):
        number_of("x", f"3 {join.join(terms)}", unit)


def test_other_parameters_and_scenario_files_take_no_unit(tmp_path: Any) -> None:
    """ROS reads the file, too."""
    for override in (
        "plant.force_jitter_seed=3m",
        "plant.publish_truth=1s",
        "plant.friction.static=0.3N",
    ):
        with pytest.raises(InvalidInputError, match=r"is invalid: must be"):
            load_scenario("feed_drive", [override])
    path = tmp_path / "scenario.yaml"
    path.write_text("/**/plant: {ros__parameters: {belt_speed: 30mm/s}}\n")
    with pytest.raises(InvalidInputError, match=r"'30mm/s' is invalid: .* in m/s, not text"):
        load_scenario(str(path))
    assert speed_of("plant.belt_speed=0xA") == 10.0  # a hexadecimal number has no unit
