"""The derivatives at the equilibrium against differences of the law, and Routh and Hurwitz."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Exponential, FrictionLaw, Linear, Stribeck
from stickslip_ros.theory.linear import expand, hurwitz_determinants
from tests.drives import PAPER

LAWS = [
    Stribeck(0.4, 0.25, 0.5),
    Coulomb(0.4),
    Linear(0.4, 0.45),
    Exponential(0.4, 0.25, 0.3, 0.05),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_derivatives_are_those_of_the_law(law: FrictionLaw) -> None:
    speed, step = 0.37, 1e-2
    drive = replace(PAPER, friction=law, belt_speed=speed)
    expansion = expand(drive)

    # Central differences of orders 1 to 3, sixth order accurate, of mu(v_r) at v_r = -speed.
    offsets = np.arange(-4, 5)
    powers = np.vander(offsets * step, increasing=True).T
    values = law.coefficient(offsets * step - speed, -1.0)
    slope, curvature, third = (
        np.linalg.solve(powers, factor * np.eye(9)[order]) @ values
        for order, factor in ((1, 1.0), (2, 2.0), (3, 6.0))
    )
    assert expansion.equilibrium[0] == pytest.approx(values[4], rel=1e-15)
    assert expansion.jacobian[1, 1] == pytest.approx(slope - drive.damping, abs=1e-9)
    assert expansion.quadratic[1, 1, 1] == pytest.approx(curvature, abs=1e-7)
    assert expansion.cubic[1, 1, 1, 1] == pytest.approx(third, abs=1e-5)
    assert expansion.jacobian_by_belt_speed[1, 1] == pytest.approx(-curvature, abs=1e-7)
    for tensor in (expansion.quadratic, expansion.cubic):
        assert np.count_nonzero(tensor) <= 1


def test_nothing_smooth_surrounds_a_slide_on_a_belt_at_rest() -> None:
    assert expand(replace(PAPER, belt_speed=0.0)) is None


def test_continuous_control_is_the_jacobian_of_the_paper() -> None:
    drive = Drive(1.0, 0.01, 1.0, 1.0, 0.49, Stribeck(0.4, 0.25, 0.5))
    expansion = expand(drive, Washout(2.0, -0.3, 7.0))
    rows = [[0.0, 1.0, 0.0], [-1.0, 0.44 - 1.8 * 0.49**2 - 0.3, 0.6], [0.0, 1.0, -2.0]]
    assert expansion.jacobian == pytest.approx(np.array(rows), abs=1e-15)


def test_a_neutral_equilibrium_is_neither_stable_nor_unstable() -> None:
    for damping, stable in ((0.0, None), (0.02, True), (1e-9, True)):
        expansion = expand(replace(PAPER, damping=damping, friction=Coulomb(0.4)))
        assert expansion.stable is stable


@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_determinants_agree_with_eigenvalues(order: int) -> None:
    random = np.random.default_rng(1)
    matrices = random.normal(size=(500, order, order)) - 1.5 * np.eye(order)
    stable = np.linalg.eigvals(matrices).real.max(axis=-1) < 0.0
    assert 20 < stable.sum() < 480
    np.testing.assert_array_equal((hurwitz_determinants(matrices) > 0.0).all(axis=-1), stable)
