"""The points of a study as columns: arrays in memory, or a table in a CSV or JSON file."""

import csv
from collections import namedtuple
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Self, TextIO

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.quantities import Quantity, quantities_of
from stickslip_ros.studies.plan import Grid, Plan

_MEASURES = quantities_of(Measures)


@dataclass(frozen=True)
class Columns:
    """The results of the n points of a study, in the order of its plan; SI units.

    All arrays have shape (n,); the turning points are a list. NaN or None marks a value that does
    not exist, such as the period of a motion at rest, and a point that is not computed yet. A
    column that has the name of a field of `Measures` is that measure of the settled motion.
    """

    plan: Plan
    """The points of the study."""
    done: npt.NDArray[np.bool_]
    """Whether the point is computed."""
    amplitude: Annotated[FloatArray, _MEASURES["amplitude"]]
    """Half of the peak-to-peak displacement, m."""
    velocity_amplitude: Annotated[FloatArray, _MEASURES["velocity_amplitude"]]
    """Half of the peak-to-peak velocity, m/s."""
    midpoint: Annotated[FloatArray, _MEASURES["midpoint"]]
    """Middle of the displacement, m."""
    period: Annotated[FloatArray, _MEASURES["period"]]
    """Duration of a cycle, s."""
    frequency: Annotated[FloatArray, _MEASURES["frequency"]]
    """Cycles per second, Hz."""
    stick_fraction: Annotated[FloatArray, _MEASURES["stick_fraction"]]
    """Share of the time in which the slide sticks to the belt, 0 to 1."""
    cycles: Annotated[npt.NDArray[np.intp], _MEASURES["cycles"]]
    """Number of cycles that the measures are means of."""
    regime: Annotated[npt.NDArray[np.object_], _MEASURES["regime"]]
    """The `Regime`, or None."""
    steady: Annotated[npt.NDArray[np.bool_], Quantity("whether the motion has settled")]
    """Whether the motion has settled."""
    turning_points: Annotated[
        list[tuple[float, ...]], Quantity("displacement where the velocity is zero", "m")
    ]
    """Poincare section x' = 0 of each point, m."""
    reason: Annotated[npt.NDArray[np.object_], Quantity("why there is no cycle")]
    """Why a point has no cycle to measure, or how it drifts, in words, or None."""

    @classmethod
    def empty(cls, plan: Plan) -> Self:
        """Return the columns of a plan of which no point is computed.

        Parameters
        ----------
        plan : Grid or RandomSample
            The points of the study.
        """
        size = plan.size
        columns: dict[str, Any] = {name: np.full(size, np.nan) for name in COLUMNS}
        columns |= {name: np.full(size, cell) for name, cell in _EMPTY.items()}
        columns["turning_points"] = [()] * size
        return cls(plan=plan, done=np.zeros(size, dtype=bool), **columns)

    @cached_property
    def values(self) -> Mapping[str, FloatArray]:
        """Values of each varied parameter, by NODE.PARAMETER."""
        rows = np.array([self.plan.values(row) for row in range(self.plan.size)], dtype=float)
        return dict(zip(self.plan.parameters, rows.T, strict=True))

    def enter(self, points: Iterable["Point"]) -> None:
        """Enter points that are computed.

        Parameters
        ----------
        points : Iterable[Point]
            The points.
        """
        columns = [getattr(self, name) for name in COLUMNS]
        for number, *cells in points:
            for column, cell in zip(columns, cells, strict=True):
                column[number] = cell
            self.done[number] = True

    def cells(self, name: str) -> Iterator[Any]:
        """Yield the values of a column, None for those that do not exist.

        Parameters
        ----------
        name : str
            Name of the column.
        """
        column = getattr(self, name)
        for value in column if isinstance(column, list) else column.tolist():
            yield None if value != value else value

    def points(self) -> Iterator["Point"]:
        """Yield the points that are computed, in their order."""
        rows = zip(self.done, *map(self.cells, COLUMNS), strict=True)
        return (Point(number, *cells) for number, (done, *cells) in enumerate(rows) if done)


COLUMNS = quantities_of(Columns)
"""Columns of a table by name, in addition to the values of the parameters."""

_EMPTY: dict[str, Any] = {"cycles": 0, "regime": None, "steady": False, "reason": None}
"""Cells of a point without a result; those of other columns are a number that does not exist."""

_Row: Any = namedtuple(  # pyright: ignore[reportUntypedNamedTuple]
    "_Row",
    ["number", *COLUMNS],
    defaults=[(_EMPTY | {"turning_points": ()}).get(name) for name in COLUMNS],
)


class Point(_Row):
    """The result of one point: its number in the plan, from 0, and a cell for each of `COLUMNS`.

    It is a row of the columns (see `Columns`), and of a journal in JSON.
    """

    @classmethod
    def from_json(cls, values: Sequence[Any]) -> Self:
        """Return the point of a list that went through JSON, the same to the last bit."""
        point = cls._make(values)
        regime = None if point.regime is None else Regime(point.regime)
        return point._replace(regime=regime, turning_points=tuple(point.turning_points))


def write_csv(stream: TextIO, columns: Columns, further: Mapping[str, Any]) -> None:
    """Write a row for each point, with turning points separated by spaces.

    Arrays of `further` columns, by name, stand before the measures.
    """
    plan = columns.plan
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*plan.parameters, *further, *COLUMNS])
    more = (column.tolist() for column in further.values())
    rows = zip(*more, *map(columns.cells, COLUMNS), strict=True)
    for number, row in enumerate(rows):
        cells = (" ".join(map(repr, cell)) if isinstance(cell, tuple) else cell for cell in row)
        writer.writerow([*plan.values(number), *cells])


def json_entries(columns: Columns, further: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters, their values, and the columns for JSON; arrays are iterators.

    For a grid, `values` has a list for each axis, and the arrays are row-major over the axes; if
    it has a continuation, the direction is the slowest index. Otherwise `values` has the
    parameters' values of each point.
    """
    plan = columns.plan
    values: Iterator[Any] = map(plan.values, range(plan.size))
    if isinstance(plan, Grid):
        values = ([*map(axis.value, range(axis.count))] for axis in plan.axes)
    return {
        "parameters": plan.parameters,
        "values": values,
        **{name: iter(cells.tolist()) for name, cells in further.items()},
        **{name: columns.cells(name) for name in COLUMNS},
    }
