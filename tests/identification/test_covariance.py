"""Covariances of fits: what rows do not tell has no finite error."""

import numpy as np
import pytest

from stickslip_ros.identification.covariance import block_covariance, propagated

_ROWS = 2400


def test_a_constant_that_rows_tell() -> None:
    random = np.random.default_rng(0)
    told, errors = random.normal(size=_ROWS), 0.5 * random.normal(size=_ROWS)
    (variance,) = np.diag(block_covariance(told[:, None], errors))
    assert np.sqrt(variance) == pytest.approx(0.5 / np.sqrt(_ROWS), rel=0.5)


def test_what_rows_do_not_tell_has_no_finite_error() -> None:
    random = np.random.default_rng(0)
    one, other, errors = random.normal(size=(3, _ROWS))
    columns = np.column_stack([one, 2.0 * one, np.zeros(_ROWS), other])
    found = block_covariance(columns, errors)
    assert np.isposinf(np.diag(found)[:3]).all()
    alone = block_covariance(other[:, None], errors)[0, 0]
    assert found[3, 3] == pytest.approx(alone, rel=0.1)
    assert not np.isnan(found).any()


def test_what_depends_on_an_untold_constant_has_no_finite_error() -> None:
    covariance = np.array([[4.0, 0.0], [0.0, np.inf]])
    linear = np.array([[1.0, 0.0], [3.0, 0.0], [1.0, 1.0]])
    found = propagated(linear, covariance)
    assert found[0].tolist() == [4.0, 12.0, 0.0]
    assert np.diag(found).tolist() == [4.0, 36.0, np.inf]


def test_no_constants_have_no_covariance() -> None:
    assert block_covariance(np.empty((_ROWS, 0)), np.ones(_ROWS)).shape == (0, 0)
