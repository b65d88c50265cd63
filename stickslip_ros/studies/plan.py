"""The points of a study: values of parameters on a grid, or random values within ranges."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import isfinite, prod
from typing import Any, ClassVar, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Parameter
from stickslip_ros.quantities import number_of
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.studies.options import Continuation
from stickslip_ros.text import by_group, did_you_mean, shown

MOST_POINTS = 10_000_000
"""Largest number of points of a study, since memory holds its results."""

_NODES = tuple(node for node in NODE_PARAMETERS if node != "analyzer")


@dataclass(frozen=True)
class Axis:
    """Values of one parameter, equally spaced on a linear or logarithmic scale.

    Raises
    ------
    InvalidInputError
        If the parameter is unknown or not a number, or a value is out of bounds.
    """

    parameter: str
    """NODE.PARAMETER, a number of the plant or a controller."""
    first: float
    """First value, in the unit of the parameter; or a text with a unit, such as "30mm/s"."""
    last: float
    """Last value; it may be below the first."""
    count: int
    """Number of values, both ends included."""
    logarithmic: bool = False
    """Whether the values are a geometric sequence instead of an arithmetic one."""

    def __post_init__(self) -> None:
        parameter, model = self._parameter, NODE_PARAMETERS[self.parameter.partition(".")[0]]
        for end in ("first", "last"):
            number = number_of(self.parameter, getattr(self, end), parameter.unit)
            object.__setattr__(self, end, number)
        ends = f"{self.first:g}:{self.last:g}"
        if not (isfinite(self.first) and isfinite(self.last)) or self.first == self.last:
            raise InvalidInputError(f"{self}: {ends} must be two different finite numbers")
        if not 2 <= self.count <= MOST_POINTS:
            raise InvalidInputError(
                f"{self}: {self.count} values: must be from 2 to {MOST_POINTS:,}"
            )
        if self.whole and not (float(self.first).is_integer() and float(self.last).is_integer()):
            raise InvalidInputError(f"{self}: {ends} must be two whole numbers")
        if self.whole and self.count > abs(self.last - self.first) + 1.0:
            raise InvalidInputError(f"{self}: there are fewer whole numbers from {ends}")
        if self.logarithmic and not self.first * self.last > 0.0:
            raise InvalidInputError(f"{self}: with :log {ends} must have one sign and exclude zero")
        for number in (0, self.count - 1):
            try:
                model.check_bounds(parameter.name, self.value(number))
            except InvalidInputError as error:
                raise InvalidInputError(f"{self}: {error}") from None

    def __str__(self) -> str:
        spacing = ":log" if self.logarithmic else ""
        return f"{self.parameter}={self.first:g}:{self.last:g}:{self.count}{spacing}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the axis described by a text.

        Parameters
        ----------
        text : str
            NODE.PARAMETER=A:B:COUNT, or NODE.PARAMETER=A:B:COUNT:log.

        Returns
        -------
        Axis
            The axis from A to B.

        Raises
        ------
        InvalidInputError
            If the text has another form, or a value is not allowed.
        """
        parameter, _, values = text.partition("=")
        parts: list[Any] = [*values.split(":"), "", ""]
        first, last, count, *spacing = parts
        try:
            if spacing not in (["", ""], ["log", "", ""]):
                raise ValueError
            return cls(parameter, first, last, int(count), spacing[0] == "log")
        except ValueError:
            raise InvalidInputError(
                f"{text:.80}: must be NODE.PARAMETER=A:B:COUNT, or A:B:COUNT:log"
            ) from None

    def value(self, number: int) -> float:
        """Return one of the values.

        Parameters
        ----------
        number : int
            Index of the value, from 0.

        Returns
        -------
        float
            The value in the unit of the parameter, rounded if that is a whole number.
        """
        return self.at(number / (self.count - 1))

    def at(self, share: float) -> float:
        """Return the value at some share of the way along the axis.

        Parameters
        ----------
        share : float
            0 for the first end, 1 for the last.

        Returns
        -------
        float
            The value in the unit of the parameter, rounded if that is a whole number.
        """
        if share == 1.0:
            value = self.last
        elif self.logarithmic:
            value = self.first * (self.last / self.first) ** share
        else:
            value = self.first + (self.last - self.first) * share
        return round(value) if self.whole else value

    def values(self) -> FloatArray:
        """Return all values, as an array of shape (count,)."""
        return np.array([self.value(number) for number in range(self.count)], dtype=float)

    @property
    def whole(self) -> bool:
        """Whether the parameter is a whole number."""
        return self._parameter.kind is int

    @property
    def unit(self) -> str:
        """Unit of the parameter; empty for a pure number."""
        return self._parameter.unit or ""

    @cached_property
    def _parameter(self) -> Parameter:
        node, _, name = self.parameter.partition(".")
        if node not in _NODES:
            raise InvalidInputError(
                f"{self.parameter:.80}: must be a parameter of {' or '.join(_NODES)}; "
                + did_you_mean(self.parameter, _numbers(*_NODES), "as in plant.belt_speed")
            )
        known = NODE_PARAMETERS[node].known
        if name not in known:
            numbers = by_group(name.partition(".")[2] for name in _numbers(node))
            every = f"numbers of {node} are {numbers}"
            raise InvalidInputError(
                f"{self.parameter:.80}: unknown parameter; "
                + did_you_mean(f"{node}.{name}", _numbers(node), every)
            )
        if known[name].kind not in (int, float):
            raise InvalidInputError(f"{self.parameter}: is not a number, so it has no range")
        return known[name]


@dataclass(frozen=True)
class ListedAxis(Axis):
    """Values of one parameter that rise or fall, by no rule."""

    listed: tuple[float, ...] = ()
    """The values."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if len({*np.sign(np.diff(self.listed)).tolist()}) > 1:
            raise InvalidInputError(f"{self}: the values must rise, or fall")

    def __str__(self) -> str:
        return f"{self.parameter}={shown(list(self.listed))}"

    def value(self, number: int) -> float:
        """Return one of the values; see `Axis.value`."""
        value = self.listed[number]
        return int(value) if self._parameter.kind is int and value == int(value) else value


def _numbers(*nodes: str) -> Iterator[str]:
    """Yield the parameters of nodes that are numbers, as NODE.PARAMETER."""
    for node in nodes:
        for name, parameter in NODE_PARAMETERS[node].known.items():
            if parameter.kind in (int, float):
                yield f"{node}.{name}"


@dataclass(frozen=True)
class _OverAxes:
    """Points that are values of parameters along axes."""

    axes: tuple[Axis, ...]
    """The axes, of different parameters; of a sample the counts do not matter."""

    def __post_init__(self) -> None:
        if len({*self.parameters}) < len(self.axes):
            raise InvalidInputError(f"{', '.join(self.parameters)}: must be different parameters")

    @property
    def parameters(self) -> tuple[str, ...]:
        """NODE.PARAMETER of the axes."""
        return tuple(axis.parameter for axis in self.axes)


@dataclass(frozen=True)
class Grid(_OverAxes):
    """All combinations of the values of one or more axes; the last axis varies fastest.

    With a `continuation`, points follow each other along the last axis, and the grid has all points
    of one direction, then all points of the other.
    """

    kind: ClassVar[str] = "grid"
    """Name of this kind of plan in journals and tables."""
    continuation: Continuation | None = None
    """Direction in which points follow each other; None: each starts in the initial state."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.size > MOST_POINTS:
            raise InvalidInputError(f"{self.size} points: must be at most {MOST_POINTS:,}")

    @property
    def directions(self) -> tuple[Continuation | None, ...]:
        """Directions in which the points follow each other; one None if they do not."""
        return (None,) if self.continuation is None else self.continuation.directions

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return tuple(axis.count for axis in self.axes)

    @property
    def size(self) -> int:
        """Number of points."""
        return len(self.directions) * prod(self.shape)

    def direction(self, index: int) -> Continuation | None:
        """Return the direction in which a point follows its neighbour.

        Parameters
        ----------
        index : int
            Index of the point, from 0.

        Returns
        -------
        Continuation or None
            UP or DOWN; None without a continuation.
        """
        return self.directions[index // prod(self.shape)]

    def values(self, index: int) -> tuple[float, ...]:
        """Return the values of the parameters at a point.

        Parameters
        ----------
        index : int
            Index of the point, from 0.

        Returns
        -------
        tuple[float, ...]
            One value for each axis, in the unit of its parameter.
        """
        numbers = np.unravel_index(index % prod(self.shape), self.shape)
        return tuple(axis.value(int(n)) for axis, n in zip(self.axes, numbers, strict=True))

    def corners(self) -> Iterator[int]:
        """Yield the indices of the points at the ends of all axes."""
        for corner in product(*((0, count - 1) for count in self.shape)):
            yield int(np.ravel_multi_index(corner, self.shape))

    def chains(self) -> Iterator[range]:
        """Yield the indices of each chain in its order; without a continuation, all together."""
        if self.continuation is None:
            yield range(self.size)
            return
        count = self.axes[-1].count
        for first in range(0, self.size, count):
            points = range(first, first + count)
            yield points[::-1] if self.direction(first) is Continuation.DOWN else points


@dataclass(frozen=True)
class RandomSample(_OverAxes):
    """Independent random values, uniformly distributed between the ends of some axes.

    For a logarithmic axis the logarithms are uniformly distributed. A point depends on the seed
    and its index only, so a larger sample starts with the points of a smaller one.
    """

    kind: ClassVar[str] = "sample"
    """Name of this kind of plan in journals and tables."""
    continuation: ClassVar[None] = None
    """None: the points of a sample are independent."""
    size: int
    """Number of points."""
    seed: int = 0
    """Seed of the random numbers, 0 or more."""

    def __post_init__(self) -> None:
        if not 1 <= self.size <= MOST_POINTS:
            raise InvalidInputError(f"{self.size} points: must be from 1 to {MOST_POINTS:,}")
        if self.seed < 0:
            raise InvalidInputError(f"seed {self.seed}: must be 0 or more")
        super().__post_init__()

    def values(self, index: int) -> tuple[float, ...]:
        """Return the values of the parameters at a point, as `Grid` does.

        Parameters
        ----------
        index : int
            Index of the point, from 0.
        """
        # The index comes first: it is one word, while numpy would mix the words of a longer seed
        # with those that follow.
        shares = np.random.default_rng((index, self.seed)).random(len(self.axes)).tolist()
        return tuple(axis.at(share) for axis, share in zip(self.axes, shares, strict=True))

    def corners(self) -> Iterator[int]:
        """Yield the indices of the first points."""
        yield from range(min(self.size, 10))

    def chains(self) -> Iterator[range]:
        """Yield all indices together."""
        yield range(self.size)


Plan = Grid | RandomSample
"""The points of a study, by index from 0."""
