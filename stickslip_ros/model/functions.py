"""Elementary functions of numbers, arrays and heyoka expressions alike, and zeros of functions."""

from collections.abc import Callable
from math import exp as float_exp
from math import expm1 as float_expm1
from math import sin as float_sin
from typing import Any

import numpy as np

_SMALLEST_SQUARE = 2.0**-80
"""Square of the smallest base of a power in an expression: the step of an integration that starts
there is not lost in the rounding of time.
"""

_ROUNDING: Any = 4.0 * np.finfo(float).eps


def _function(name: str, x: Any) -> Any:
    if isinstance(x, int | float | complex | np.ndarray | np.generic):
        return getattr(np, name)(x)
    if hasattr(x, name):  # a symbol of an exported law
        return getattr(x, name)()
    import heyoka  # what computes with no expressions does not load it

    return getattr(heyoka, name)(x)


def exp(x: Any) -> Any:
    """Return the exponential of a float, an array or an expression."""
    return float_exp(x) if type(x) is float else _function("exp", x)


def sin(x: Any) -> Any:
    """Return the sine of a float, an array or an expression."""
    return float_sin(x) if isinstance(x, float) else _function("sin", x)


def expm1(x: Any) -> Any:
    """Return exp(x) - 1 of a float, an array or an expression."""
    return float_expm1(x) if isinstance(x, float) else _function("expm1", x)


def power(base: Any, exponent: Any) -> Any:
    """Return a power of a float, an array or an expression; 0 for a number below zero.

    The base of an expression may pass zero, where the series of a power is not finite: it is kept
    1e-12 away from there.
    """
    if isinstance(base, int | float | np.ndarray | np.generic):
        return np.maximum(base, 0.0) ** exponent
    return (base * base + _SMALLEST_SQUARE) ** (0.5 * exponent)


def zero_between(function: Callable[[float], float], low: float, high: float) -> float:
    """Return where `function` changes sign; it must have opposite signs at `low` and `high`."""
    from scipy.optimize import brentq  # importing it takes longer than numpy and heyoka together

    zero: Any = brentq(function, low, high, xtol=1e-300, rtol=_ROUNDING, maxiter=1000)
    return float(zero)
