"""Zeros of functions of one variable, to rounding."""

from collections.abc import Callable
from typing import Any

import numpy as np

_ROUNDING: Any = 4.0 * np.finfo(float).eps


def zero_between(function: Callable[[float], float], low: float, high: float) -> float:
    """Return where `function` changes sign; it must have opposite signs at `low` and `high`."""
    from scipy.optimize import brentq  # importing it takes longer than numpy and heyoka together

    found: Any = brentq(function, low, high, xtol=1e-300, rtol=_ROUNDING, maxiter=1000)
    return float(found)
