"""Power series in time with expressions as coefficients: the motion between two samples."""

from collections.abc import Callable
from typing import Any


class Series:
    """Power series; polynomials accept it, with numbers and expressions as their constants.

    Its coefficients are made from those before when they are asked for, and kept.
    """

    def __init__(self, coefficient: Callable[[int], Any]) -> None:
        self._coefficient, self._known = coefficient, list[Any]()

    def __getitem__(self, number: int) -> Any:
        while len(self._known) <= number:
            self._known.append(self._coefficient(len(self._known)))
        return self._known[number]

    def __add__(self, other: Any) -> "Series":
        if isinstance(other, Series):
            return Series(lambda k: self[k] + other[k])
        return Series(lambda k: self[k] if k else self[k] + other)

    __radd__ = __add__

    def __neg__(self) -> "Series":
        return self * -1.0

    def __sub__(self, other: Any) -> "Series":
        return self + -other

    def __rsub__(self, other: Any) -> "Series":
        return -self + other

    def __mul__(self, other: Any) -> "Series":
        if isinstance(other, Series):
            return Series(lambda k: sum(self[i] * other[k - i] for i in range(k + 1)))
        return Series(lambda k: self[k] * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Series":
        return self * (1.0 / other)
