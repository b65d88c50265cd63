"""A measured friction law, from a table."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite, nextafter
from typing import Any, ClassVar, Self

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.friction.base import FrictionLaw, Numbers, Values


@dataclass(frozen=True)
class Table(FrictionLaw):
    """Table of coefficients by |v_r|: exact at its points, and monotone wherever these are.

    Between the points it is the cubic Hermite spline of Fritsch and Butland, SIAM J. Sci. Stat.
    Comput. 5, 1984 (PCHIP), which is continuously differentiable. Beyond the last point it is
    constant. The coefficient of the first point is the static one.
    """

    name: ClassVar[str] = "table"
    switches: ClassVar[Sequence[str]] = (
        "lower", "upper", "first", "last", "c0", "c1", "c2", "c3",
    )  # fmt: skip
    points: tuple[tuple[float, float], ...] = field(default=((0.0, 0.4), (0.5, 0.25)))
    """Speeds |v_r| (m/s), the first of which is 0, each with its coefficient."""
    static: Any = field(default=0.0, kw_only=True)
    """Static coefficient: that of the first point, whatever is given."""

    def __post_init__(self) -> None:
        if isinstance(self.static, int | float):  # otherwise it is a symbol
            first = self.points[0][1] if self.points else 0.0
            object.__setattr__(self, "static", first)

    @override
    def multiplied(self, factor: float) -> Self:
        return replace(self, points=tuple((speed, factor * mu) for speed, mu in self.points))

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        speed = np.asarray(relative_speed * sign)
        piece = np.maximum(np.searchsorted(self._speeds, speed, side="right") - 1, 0)
        return self.friction(
            relative_speed, sign, (), tuple(np.moveaxis(self._pieces[piece], -1, 0))
        )

    def friction(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Any:
        """Return the coefficient in a piece; see `FrictionMemory.friction`."""
        lower, _, _, _, c0, c1, c2, c3 = switches
        speed = relative_speed * sign - lower
        return -sign * (c0 + speed * (c1 + speed * (c2 + speed * c3)))

    def margins(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Values:
        """Return the distances to the ends, 1 for no end; see `FrictionMemory.margins`.

        At high speeds they are relative to the upper one: rounding stays small beside them.
        """
        lower, upper, first, last, *_ = switches
        speed, scale = relative_speed * sign, 1.0 + upper
        return (
            first + (1.0 - first) * (speed - lower) / scale,
            last + (1.0 - last) * (upper - speed) / scale,
        )

    def switches_at(self, relative_speed: float, sign: float, memory: Numbers) -> Numbers:
        """Return the piece at a speed; see `FrictionMemory.switches_at`."""
        return self._piece(relative_speed * sign)

    def switches_after(self, margin: int, sign: float, switches: Numbers) -> Numbers:
        """Return the piece below (margin 0) or above (1); see `FrictionMemory.switches_after`."""
        lower, upper, *_ = switches
        return self._piece(upper) if margin else self._piece(nextafter(lower, 0.0))

    @property
    def size_range(self) -> tuple[float, float]:
        """The extremes of the points: between them the table is monotone."""
        sizes = [size for _, size in self.points]
        return min(sizes), max(sizes)

    def refusal(self) -> str | None:
        """Refuse points that make no table, without what may be from a foreign file."""
        if not self.points:
            return "the table has no points: must have at least one"
        before = None
        for number, (speed, coefficient) in enumerate(self.points, start=1):
            place = f"point {number} of the table"
            if not (isfinite(coefficient) and coefficient >= 0.0):
                return f"{place}: the coefficient must be a finite number at least 0"
            if before is None and speed != 0.0:
                return f"{place}: the speed must be 0"
            if before is not None and not (isfinite(speed) and speed > before):
                return f"{place}: the speed must be finite and above the one before"
            before = speed
        return None

    @override
    def scaled(self, speed: float, length: float = 1.0) -> Self:
        return replace(self, points=tuple((knot / speed, value) for knot, value in self.points))

    @cached_property
    def _speeds(self) -> list[float]:
        return [speed for speed, _ in self.points]

    @cached_property
    def _pieces(self) -> FloatArray:
        """Switches of each piece, a row each."""
        from scipy.interpolate import PchipInterpolator  # takes long to import

        speeds, values = np.array(self.points, dtype=float).T
        pieces = np.zeros((len(speeds), len(self.switches)))
        pieces[:, 0] = speeds
        # One more point, so that the slope is 0 where the constant begins.
        beyond = 2.0 * speeds[-1] or 1.0
        pieces[:, 1] = [*speeds[1:], beyond]
        pieces[0, 2] = pieces[-1, 3] = 1.0
        pieces[-1, 4] = values[-1]
        cubics = PchipInterpolator([*speeds, beyond], [*values, values[-1]]).c
        pieces[:-1, 4:] = cubics[::-1, :-1].T
        return pieces

    def _piece(self, speed: float) -> Numbers:
        number = max(bisect_right(self._speeds, speed) - 1, 0)
        return tuple(self._pieces[number].tolist())
