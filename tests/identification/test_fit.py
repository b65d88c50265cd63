"""Covariances of fits: what rows do not tell has no finite error; the choice of a law."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stickslip_ros.identification.choice import Candidate, choose
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


def candidate(
    name: str, errors: list[float], variances: list[float], least_gain: float = 0.0
) -> Candidate:
    """Return a fit with an error in each block, a share, and variances of its constants."""
    law = SimpleNamespace(name=name, deflection=0.0)
    fit: Any = SimpleNamespace(
        law=law,
        point=variances,
        covariance=np.diag(variances),
        has_spring=False,
        scale=1.0,
        least_gain=least_gain,
    )
    return Candidate(fit, np.square(errors))


def test_the_simplest_within_the_error_is_chosen() -> None:
    """An error that scatters much is within that of the best one, but no reason for more."""
    best = candidate("table", [0.050] * 6, [1.0] * 9)
    plain = candidate("coulomb", [0.056, 0.057, 0.058] * 2, [1.0] * 5)
    rough = candidate("stribeck", [0.03, 0.08, 0.05] * 2, [1.0] * 7)
    assert plain.error < rough.error
    chosen, as_good = choose([rough, plain, best])
    assert chosen is plain
    assert as_good == {"stribeck": True, "coulomb": True, "table": True}


def test_a_gain_that_is_that_of_the_filters_is_none() -> None:
    for least_gain, name in ((0.0, "table"), (3e-3, "coulomb")):
        best = candidate("table", [0.0113, 0.0114] * 3, [1.0] * 9, least_gain)
        plain = candidate("coulomb", [0.0135, 0.0136] * 3, [1.0] * 5, least_gain)
        assert choose([plain, best])[0].law == name


def test_a_law_with_constants_that_are_not_told_is_not_chosen() -> None:
    untold = candidate("coulomb", [0.05] * 6, [1.0, np.inf])
    told = candidate("stribeck", [0.05] * 6, [1.0] * 3)
    assert choose([untold, told])[0] is told
    assert choose([untold])[0] is untold
