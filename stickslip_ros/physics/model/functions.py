"""Elementary functions of floats, complex numbers, arrays and heyoka expressions alike."""

from math import sin as float_sin
from typing import Any

import numpy as np


def _function(name: str, x: Any) -> Any:
    if isinstance(x, int | float | complex | np.ndarray | np.generic):
        return getattr(np, name)(x)
    import heyoka  # what computes with no expressions does not load it

    return getattr(heyoka, name)(x)


def exp(x: Any) -> Any:
    """Return the exponential of a float, an array or an expression."""
    return _function("exp", x)


def sin(x: Any) -> Any:
    """Return the sine of a float, an array or an expression."""
    return float_sin(x) if isinstance(x, float) else _function("sin", x)


def power(base: Any, exponent: Any) -> Any:
    """Return a power of a float, an array or an expression above zero."""
    return base**exponent
