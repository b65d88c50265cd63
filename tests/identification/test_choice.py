"""The choice of a law by the errors of held-out parts."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from stickslip_ros.identification.choice import choose
from stickslip_ros.identification.fit import Fit


def candidate(
    name: str, errors: list[float], variances: list[float], least_gain: float = 0.0
) -> Fit:
    """Return a fit with an error in each block, a share, and variances of its constants."""
    found: Any = SimpleNamespace(
        label=name,
        size=len(variances),
        covariance=np.diag(variances),
        least_gain=least_gain,
        held_out=np.square(errors),
        error=float(np.sqrt(np.mean(np.square(errors)))),
    )
    return found


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
        assert choose([plain, best])[0].label == name


def test_a_law_with_constants_that_are_not_told_is_not_chosen() -> None:
    untold = candidate("coulomb", [0.05] * 6, [1.0, np.inf])
    told = candidate("stribeck", [0.05] * 6, [1.0] * 3)
    assert choose([untold, told])[0] is told
    assert choose([untold])[0] is untold
