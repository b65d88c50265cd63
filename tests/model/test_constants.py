"""The description of constants: units, bounds, and scaling by hand-computed values."""

from dataclasses import dataclass
from typing import Any

import pytest

from stickslip_ros.model.constants import Scales, constant, scaled, unit_powers

SCALES = Scales(length=2.0, speed=8.0, force=32.0)
"""A unit of time of 2 / 8 = 0.25 s and a unit of mass of 32 0.25^2 / 2 = 1 kg."""


@dataclass(frozen=True)
class Part:
    stiffness: Any = constant(3.0, "Stiffness of the part.", "N/m", positive=True)
    loss: Any = constant(0.5, "Loss of the part.", at_least=0.0)
    amplitude: Any = constant(6.0, "Amplitude of the part.", "N")
    note: str = "not a constant"


@pytest.mark.parametrize(
    ("unit", "powers"),  # of length, time, force
    [
        (None, (0, 0, 0)),
        ("1", (0, 0, 0)),
        ("rad", (0, 0, 0)),
        ("m", (1, 0, 0)),
        ("m/s", (1, -1, 0)),
        ("s/m", (-1, 1, 0)),
        ("1/m", (-1, 0, 0)),
        ("Hz", (0, -1, 0)),
        ("rad/s", (0, -1, 0)),
        ("N s/m", (-1, 1, 1)),
        ("N s^3/m^3", (-3, 3, 1)),
        ("N/m/s", (-1, -1, 1)),
        ("N/m s", (-1, -1, 1)),  # all after the slash is divided by
        ("N/(m s)", (-1, -1, 1)),
        ("N s/(m^2 rad)", (-2, 1, 1)),
        ("kg", (-1, 2, 1)),
        ("kg m/s^2", (0, 0, 1)),
    ],
)
def test_the_powers_of_a_unit(unit: str | None, powers: tuple[int, int, int]) -> None:
    assert unit_powers(unit) == powers


def test_the_factor_of_a_unit() -> None:
    units = {None: 1.0, "Hz": 1.0 / 4.0, "s/m": 8.0, "N s^3/m^3": 512.0 / 32.0, "N/m": 2.0 / 32.0}
    assert {unit: SCALES.factor(unit) for unit in units} == units


def test_a_power_of_a_speed_does_not_depend_on_the_length() -> None:
    assert Scales(length=0.1, speed=0.3).factor("s/m") == 0.3
    assert Scales(length=0.7, speed=0.3).factor("m^2/s^2") == 0.3**-2


def test_a_scaled_part_has_its_constants_in_the_new_units() -> None:
    assert scaled(Part(), SCALES) == Part(3.0 * 2.0 / 32.0, 0.5, 6.0 / 32.0)


@pytest.mark.parametrize(
    ("unit", "reason"),
    [
        ("mm", "unit 'mm': 'mm' is none of m, s, N, kg, Hz, rad, 1"),
        ("N s/inch", "'inch' is none of"),
        ("m^x", "the power of m must be a whole number"),
        ("m^-1", "the power of m must be a whole number"),
    ],
)
def test_an_unknown_unit_is_refused(unit: str, reason: str) -> None:
    with pytest.raises(ValueError, match=r"^unit") as refused:
        constant(1.0, "Length.", unit)
    assert reason in str(refused.value)
