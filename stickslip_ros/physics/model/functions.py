"""Elementary functions of floats, complex numbers, arrays and heyoka expressions alike."""

from math import sin as float_sin
from typing import Any

import numpy as np

_SMALLEST_SQUARE = 2.0**-80
"""Square of the smallest base of a power in an expression: the step of an integration that starts
there is not lost in the rounding of time.
"""


def _function(name: str, x: Any) -> Any:
    if isinstance(x, int | float | complex | np.ndarray | np.generic):
        return getattr(np, name)(x)
    import heyoka  # what computes with no expressions does not load it

    return getattr(heyoka, name)(x)


def exp(x: Any) -> Any:
    """Return the exponential of a float, an array or an expression."""
    return _function("exp", x)


def log(x: Any) -> Any:
    """Return the natural logarithm of a float, an array or an expression."""
    return _function("log", x)


def sqrt(x: Any) -> Any:
    """Return the square root of a float, an array or an expression."""
    return _function("sqrt", x)


def sin(x: Any) -> Any:
    """Return the sine of a float, an array or an expression."""
    return float_sin(x) if isinstance(x, float) else _function("sin", x)


def power(base: Any, exponent: Any) -> Any:
    """Return a power of a float, an array or an expression; 0 for a number below zero.

    The base of an expression may pass zero, where the series of a power is not finite: it is kept
    1e-12 away from there.
    """
    if isinstance(base, int | float | np.ndarray | np.generic):
        return np.maximum(base, 0.0) ** exponent
    return (base * base + _SMALLEST_SQUARE) ** (0.5 * exponent)
