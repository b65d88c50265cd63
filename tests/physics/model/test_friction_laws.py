from dataclasses import astuple
from math import exp

import heyoka
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stickslip_ros.physics.model.friction import (
    LAWS,
    Coulomb,
    Exponential,
    FrictionLaw,
    Linear,
    Stribeck,
)

STRIBECK = Stribeck(static=0.4, minimum=0.25, minimum_speed=0.5)
COULOMB = Coulomb(static=0.4)
LINEAR = Linear(static=0.4, slope=0.9)
EXPONENTIAL = Exponential(static=0.4, kinetic=0.25, decay_speed=0.5, viscous=0.1)
EVERY_LAW = [STRIBECK, COULOMB, LINEAR, EXPONENTIAL]

speeds = st.floats(-5.0, 5.0)
signs = st.sampled_from([-1.0, 1.0])
laws = st.sampled_from(EVERY_LAW)


# The cubic has a = 3 (0.4 - 0.25) / (2 0.5) = 0.45 and b = (0.4 - 0.25) / (2 0.5^3) = 0.6.
@pytest.mark.parametrize(
    ("law", "relative_speed", "expected"),
    [
        (STRIBECK, -0.4, 0.4 - 0.45 * 0.4 + 0.6 * 0.4**3),
        (STRIBECK, -0.5, 0.25),
        (STRIBECK, -1.0, 0.55),
        (STRIBECK, 0.2, -0.4 + 0.45 * 0.2 - 0.6 * 0.2**3),
        (COULOMB, -0.7, 0.4),
        (COULOMB, 3.0, -0.4),
        (LINEAR, -0.2, 0.4 - 0.9 * 0.2),
        (LINEAR, 0.3, -0.4 + 0.9 * 0.3),
        (EXPONENTIAL, -0.5, 0.25 + 0.15 * exp(-1.0) + 0.1 * 0.5),
        (EXPONENTIAL, 1.0, -(0.25 + 0.15 * exp(-2.0) + 0.1)),
    ],
)
def test_coefficient(law: FrictionLaw, relative_speed: float, expected: float) -> None:
    sign = np.sign(relative_speed)
    assert law.coefficient(relative_speed, sign) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_friction_starts_at_the_static_coefficient(law: FrictionLaw, sign: float) -> None:
    assert law.coefficient(0.0, sign) == pytest.approx(-0.4 * sign, rel=1e-15)


@given(laws, speeds, signs)
def test_friction_is_odd(law: FrictionLaw, speed: float, sign: float) -> None:
    assert law.coefficient(-speed, -sign) == -law.coefficient(speed, sign)


@given(st.floats(0.0, 2.0))
def test_stribeck_friction_is_smallest_at_the_minimum_speed(speed: float) -> None:
    assume(abs(speed - 0.5) > 1e-6)
    assert STRIBECK.coefficient(-speed, -1.0) > STRIBECK.coefficient(-0.5, -1.0)


@given(laws, speeds, signs, st.floats(1e-3, 1e3))
def test_scaled_law_gives_the_same_coefficient(
    law: FrictionLaw, speed: float, sign: float, unit: float
) -> None:
    assert law.scaled(unit).coefficient(speed / unit, sign) == pytest.approx(
        law.coefficient(speed, sign), rel=1e-12, abs=1e-12
    )


@pytest.mark.parametrize("law", EVERY_LAW)
def test_arrays_and_symbols_give_what_numbers_give(law: FrictionLaw) -> None:
    relative_speeds = np.array([-1.5, -0.3, -0.0, 0.0, 0.2, 2.5])
    directions = np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])
    one_by_one = [
        float(law.coefficient(float(speed), float(sign)))
        for speed, sign in zip(relative_speeds, directions, strict=True)
    ]
    speed, sign = heyoka.make_vars("speed", "sign")
    compiled = heyoka.cfunc([law.coefficient(speed, sign)], [speed, sign])
    np.testing.assert_allclose(law.coefficient(relative_speeds, directions), one_by_one, rtol=1e-14)
    np.testing.assert_allclose(
        compiled(np.array([relative_speeds, directions]))[0], one_by_one, rtol=1e-14
    )


@pytest.mark.parametrize("law", EVERY_LAW)
def test_a_law_is_found_by_its_name_and_made_from_its_constants(law: FrictionLaw) -> None:
    assert LAWS[law.name](*astuple(law)) == law
    assert law.constants()[0] == "static"
