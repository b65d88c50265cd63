"""The drive: its scales, its modes, and what of a force is normal force or coefficient."""

from array import array
from dataclasses import replace
from math import inf, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import SIGN, SPEED
from stickslip_ros.model.friction import Coulomb, Stribeck
from stickslip_ros.model.hybrid import Instant
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.model.signals import sine
from tests.drives import FEED_DRIVE, PAPER


def test_scales_of_a_feed_drive() -> None:
    assert FEED_DRIVE.angular_frequency == pytest.approx(100.0)  # sqrt(1e6 / 100)
    assert FEED_DRIVE.natural_period == pytest.approx(2.0 * pi / 100.0)
    assert FEED_DRIVE.length_scale == pytest.approx(1e-3)  # 1000 / 1e6
    assert FEED_DRIVE.speed_scale == pytest.approx(0.1)  # 1000 / sqrt(1e6 * 100)
    assert FEED_DRIVE.damping_coefficient == pytest.approx(0.02)  # 200 / sqrt(1e6 * 100)


def test_without_a_spring_the_unit_of_speed_is_a_metre_per_second() -> None:
    axis = replace(FEED_DRIVE, stiffness=0.0, bias_force=30.0)
    assert not axis.has_spring
    assert axis.natural_period == inf
    assert axis.speed_scale == axis.length_scale * axis.angular_frequency == 1.0
    # With m = N = 1: a force of N accelerates the mass by one unit.
    assert axis.mass * axis.length_scale * axis.angular_frequency**2 == axis.normal_force
    unit = axis.dimensionless
    assert (unit.mass, unit.stiffness, unit.normal_force) == (1.0, 0.0, 1.0)
    assert (unit.damping, unit.bias_force, unit.belt_speed) == (0.2, 0.03, 0.04)
    assert unit.dimensionless == unit
    assert not unit.is_dimensionless


def test_without_a_spring_there_is_no_equilibrium_position() -> None:
    with pytest.raises(InvalidInputError, match="stiffness = 0 N/m: without a spring"):
        _ = replace(FEED_DRIVE, stiffness=0.0).equilibrium_position


def test_a_bias_force_bends_the_spring() -> None:
    biased = replace(FEED_DRIVE, friction=Coulomb(0.3), bias_force=50.0)
    assert biased.equilibrium_position == pytest.approx((300.0 + 50.0) / 1e6, rel=1e-15)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_slide_that_has_passed_a_moving_belt_slips_the_other_way(sign: float) -> None:
    belt = sine(0.5 * PAPER.belt_speed, frequency=0.1 / PAPER.natural_period)
    system = drive_system(replace(PAPER, belt=belt))
    instant = Instant(memoryview(array("d", [0.0, 0.0])), [0.0], time=3.0)
    belt_speed = system.belt_speed(system.starting_mode(instant), instant.time)
    instant.state[SPEED] = belt_speed + 1e-3 * sign
    mode = system.starting_mode(instant)
    assert mode.switches[SIGN] == sign
    assert system.settled(mode, instant) is mode
    instant.state[SPEED] = belt_speed - 1e-3 * sign
    assert system.settled(mode, instant).switches[SIGN] == -sign


@given(st.floats(-3.0, 6.0))
def test_the_unit_of_force_is_of_the_size_of_friction(exponent: float) -> None:
    normal_force = 10.0**exponent
    drive = Drive(normal_force=normal_force, friction=Coulomb(400.0 / normal_force))
    assert 400.0 / 8.0 <= drive.force_scale <= 400.0 * 2.0**10
    assert drive.dimensionless.friction.static * drive.force_scale == pytest.approx(400.0)


def test_usual_coefficients_leave_the_normal_force_as_the_unit() -> None:
    assert Drive(normal_force=1000.0, friction=Stribeck(0.4, 0.25, 0.05)).force_scale == 1000.0
