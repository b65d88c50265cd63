"""Which points a study has: values of parameters on a grid, or random ones within ranges."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import isfinite, prod
from typing import ClassVar, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.deprecated_names import moved_from
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.parameter_field import Parameter, known_parameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.studies.options import Carry
from stickslip_ros.text import did_you_mean

MOST_POINTS = 1_000_000_000
"""Points of a study: what is to be kept of them has to go into a file."""

_NODES = ("plant", "washout_controller")


@dataclass(frozen=True)
class Axis:
    """Values of one parameter, from one to another."""

    parameter: str
    """NODE.PARAMETER, a number of plant or washout_controller."""
    first: float
    last: float
    count: int
    """Of values, both ends included."""
    logarithmic: bool = False
    """Whether the values are a geometric sequence, not an arithmetic one."""

    def __post_init__(self) -> None:
        parameter, model = self._parameter, NODE_PARAMETERS[self.parameter.partition(".")[0]]
        ends = f"{self.first:g}:{self.last:g}"
        if not (isfinite(self.first) and isfinite(self.last)) or self.first == self.last:
            raise InvalidInputError(f"{self}: {ends} must be two different finite numbers")
        if not 2 <= self.count <= MOST_POINTS:
            raise InvalidInputError(
                f"{self}: {self.count} values are not from 2 to {MOST_POINTS:,} of them"
            )
        if self._parameter.kind is int and self.count > abs(self.last - self.first) + 1.0:
            raise InvalidInputError(f"{self}: from {ends} there are fewer whole numbers")
        if self.logarithmic and not self.first * self.last > 0.0:
            raise InvalidInputError(f"{self}: with :log {ends} must be of one sign, without zero")
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
        """Return the axis that NODE.PARAMETER=A:B:COUNT, or A:B:COUNT:log, stands for.

        Raises InvalidInputError for anything else, and for values that are not allowed.
        """
        parameter, _, values = text.partition("=")
        first, last, count, *spacing = [*values.split(":"), "", ""]
        try:
            if spacing not in (["", ""], ["log", "", ""]):
                raise ValueError
            ends, number = (float(first), float(last)), int(count)
        except ValueError:
            raise InvalidInputError(
                f"{text:.80}: must be NODE.PARAMETER=A:B:COUNT, or A:B:COUNT:log"
            ) from None
        return cls(parameter, *ends, number, spacing[0] == "log")

    def value(self, number: int) -> float:
        """Return one of the values; of a parameter that is a whole number, the nearest such."""
        value = self.last if number == self.count - 1 else self.at(number / (self.count - 1))
        return round(value) if self._parameter.kind is int else value

    def at(self, share: float) -> float:
        """Return what lies at some share of the way, from 0 to 1."""
        if self.logarithmic:
            return self.first * (self.last / self.first) ** share
        return self.first + (self.last - self.first) * share

    def values(self) -> FloatArray:
        """Return all values."""
        return np.array([self.value(number) for number in range(self.count)], dtype=float)

    @property
    def unit(self) -> str:
        """Unit of the parameter; empty for a pure number."""
        return self._parameter.unit or ""

    @property
    def _parameter(self) -> Parameter:
        node, _, name = self.parameter.partition(".")
        if node not in _NODES:
            raise InvalidInputError(
                f"{self.parameter:.80}: must be a parameter of {' or '.join(_NODES)}; "
                + did_you_mean(self.parameter, _numbers(*_NODES), "as in plant.belt_speed")
            )
        known = known_parameters(NODE_PARAMETERS[node])
        if name not in known:
            every = f"numbers of {node} are {', '.join(sorted(_numbers(node)))}"
            raise InvalidInputError(
                f"{self.parameter:.80}: unknown parameter; "
                + did_you_mean(f"{node}.{name}", _numbers(*_NODES), every)
            )
        if known[name].kind not in (int, float):
            raise InvalidInputError(f"{self.parameter}: is no number, and has no values between")
        return known[name]


def _numbers(*nodes: str) -> Iterator[str]:
    """Yield the parameters of nodes that are numbers, as NODE.PARAMETER."""
    for node in nodes:
        for name, parameter in known_parameters(NODE_PARAMETERS[node]).items():
            if parameter.kind in (int, float):
                yield f"{node}.{name}"


@dataclass(frozen=True)
class Grid:
    """All combinations of the values of one axis or several, the last varying fastest.

    Carried on from neighbour to neighbour along the last axis, they are there once for each
    direction: all points of the one, then all of the other.
    """

    kind: ClassVar[str] = "grid"
    """Name of such a plan in journals and tables."""
    axes: tuple[Axis, ...]
    carry: Carry | None = None

    def __post_init__(self) -> None:
        _check_different(self.parameters)
        if self.size > MOST_POINTS:
            raise InvalidInputError(f"{self.size} points are more than {MOST_POINTS:,}")

    @property
    def parameters(self) -> tuple[str, ...]:
        """NODE.PARAMETER of the axes."""
        return tuple(axis.parameter for axis in self.axes)

    @property
    def directions(self) -> tuple[Carry | None, ...]:
        """In which the points are carried on; one None if they are not."""
        return (None,) if self.carry is None else self.carry.directions

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of the axes' values."""
        return tuple(axis.count for axis in self.axes)

    @property
    def size(self) -> int:
        """Number of points."""
        return len(self.directions) * prod(self.shape)

    @property
    def carried(self) -> bool:
        """Whether each point of a chain begins where the one before ended."""
        return self.carry is not None

    def direction(self, index: int) -> Carry | None:
        """Return the direction in which a point is carried on."""
        return self.directions[index // prod(self.shape)]

    def values(self, index: int) -> tuple[float, ...]:
        """Return the values of the parameters at a point."""
        values: list[float] = []
        for axis in reversed(self.axes):
            index, number = divmod(index, axis.count)
            values.append(axis.value(number))
        return tuple(reversed(values))

    def corners(self) -> Iterator[int]:
        """Yield the points at the ends of all axes."""
        for ends in product((0, 1), repeat=len(self.axes)):
            index = 0
            for axis, end in zip(self.axes, ends, strict=True):
                index = index * axis.count + end * (axis.count - 1)
            yield index

    def chains(self) -> Iterator[range]:
        """Yield the points in the order in which they are carried on; else, all at once."""
        if self.carry is None:
            yield range(self.size)
            return
        count = self.axes[-1].count
        for first in range(0, self.size, count):
            points = range(first, first + count)
            yield points[::-1] if self.direction(first) is Carry.DOWN else points


@dataclass(frozen=True)
class RandomSample:
    """Values that are uniformly distributed between the ends of some axes, independent of another.

    Between those of a logarithmic axis it is their logarithms that are.

    A point follows from the seed and its index: of two samples with one seed, the larger begins
    with the smaller.
    """

    kind: ClassVar[str] = "sample"
    """Name of such a plan in journals and tables."""
    axes: tuple[Axis, ...]
    """Whose counts do not matter."""
    size: int
    seed: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.size <= MOST_POINTS:
            raise InvalidInputError(f"{self.size} points are not from 1 to {MOST_POINTS:,} of them")
        if self.seed < 0:
            raise InvalidInputError(f"seed {self.seed}: must be 0 or more")
        _check_different(self.parameters)

    @property
    def parameters(self) -> tuple[str, ...]:
        """NODE.PARAMETER of the axes."""
        return tuple(axis.parameter for axis in self.axes)

    @property
    def carried(self) -> bool:
        """Never."""
        return False

    def values(self, index: int) -> tuple[float, ...]:
        """Return the values of the parameters at a point."""
        # The index first: it is one word, and what numpy makes of words does not tell where a
        # longer seed ends.
        shares = np.random.default_rng((index, self.seed)).random(len(self.axes)).tolist()
        return tuple(axis.at(share) for axis, share in zip(self.axes, shares, strict=True))

    def corners(self) -> Iterator[int]:
        """Yield the first points."""
        yield from range(min(self.size, 10))

    def chains(self) -> Iterator[range]:
        """Yield all points at once."""
        yield range(self.size)


Plan = Grid | RandomSample
"""The points of a study, by their index from 0 on."""


def _check_different(parameters: Sequence[str]) -> None:
    if len(set(parameters)) < len(parameters):
        raise InvalidInputError(f"{', '.join(parameters)}: must be different parameters")


__getattr__ = moved_from(__name__)
