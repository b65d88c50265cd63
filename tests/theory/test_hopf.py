"""Hopf points against the paper; test_critical_gains has the closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.model.control import Washout
from stickslip_ros.model.friction import Coulomb, Exponential, Linear, Stribeck
from stickslip_ros.model.signals import sine
from stickslip_ros.theory.hopf import hopf_distance, hopf_points, hopf_ratio
from stickslip_ros.theory.linear import expand, hurwitz_determinants, jacobians
from tests.drives import FEED_DRIVE, PAPER


@pytest.mark.parametrize(
    "law", [Coulomb(0.4), Linear(0.4, 0.45), Linear(0.4, -0.1), Stribeck(0.4, 0.4, 0.5)]
)
def test_laws_of_constant_slope_have_no_hopf_speed(law: Linear) -> None:
    assert hopf_points(replace(PAPER, friction=law)) == []


def test_the_exponential_law_is_subcritical() -> None:
    law = Exponential(0.4, 0.25, 0.2, 0.0)
    (point,) = hopf_points(replace(PAPER, friction=law))
    # 0.15 exp(-v/0.2) / 0.2 = 0.02, and the third derivative there is 0.02 / 0.2^2.
    assert 0.75 * 2.718281828459045 ** (-point.belt_speed / 0.2) == pytest.approx(0.02, rel=1e-12)
    assert point.first_lyapunov_coefficient == pytest.approx(0.02 / 0.04 / 16.0, rel=1e-12)
    assert not point.supercritical


def test_real_eigenvalues_of_opposite_sign_are_no_hopf_point() -> None:
    gains = Washout(10.0, 15.0, 0.0)
    speeds = np.geomspace(1e-3, 10.0, 2001)
    margins = hurwitz_determinants(jacobians(PAPER, gains, speeds))[:, -1]
    assert np.count_nonzero(np.diff(np.sign(margins))) == 2
    (point,) = hopf_points(PAPER, gains)
    expansion = expand(replace(PAPER, belt_speed=point.belt_speed), gains)
    pair = [value for value in expansion.eigenvalues if value.imag > 0.0]
    assert [abs(value.real) < 1e-10 for value in pair] == [True]


def test_the_distance_from_the_hopf_speed() -> None:
    for speed in (40.0, -40.0):
        drive = replace(FEED_DRIVE, belt_speed=speed)
        assert hopf_ratio(drive) == pytest.approx(40.0 / 0.048876, rel=1e-4)
        assert hopf_distance(drive) == (
            "40 m/s is 818.4 times the critical speed of 48.88 mm/s (belt speeds are in m/s)"
        )
    assert hopf_distance(PAPER) == "0.4 is 0.8184 times the critical speed of 0.4888"
    for drive in (
        replace(FEED_DRIVE, friction=Coulomb(0.4)),
        replace(FEED_DRIVE, belt_speed=0.0),
        replace(FEED_DRIVE, stiffness=0.0),  # not covered by the theory, like the next one
        replace(FEED_DRIVE, load=sine(amplitude=100.0)),
    ):
        assert hopf_ratio(drive) is None
        assert hopf_distance(drive) == ""
