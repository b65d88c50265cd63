"""The Routh-Hurwitz determinants of larger systems."""

import numpy as np
import pytest

from stickslip_ros.physics.theory.linear import hurwitz_determinants


@pytest.mark.parametrize("order", [4, 5])
def test_determinants_agree_with_eigenvalues(order: int) -> None:
    random = np.random.default_rng(1)
    matrices = random.normal(size=(500, order, order)) - 1.5 * np.eye(order)
    stable = np.linalg.eigvals(matrices).real.max(axis=-1) < 0.0
    assert 20 < stable.sum() < 480
    np.testing.assert_array_equal((hurwitz_determinants(matrices) > 0.0).all(axis=-1), stable)
