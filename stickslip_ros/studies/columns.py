"""The points of a study as columns: arrays in memory, or a table in a CSV or JSON file."""

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self, TextIO

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import CycleMeasures
from stickslip_ros.quantities import quantities_of
from stickslip_ros.studies.plan import Grid, Plan
from stickslip_ros.studies.study import COLUMNS, Point, Study


@dataclass(frozen=True)
class Columns(CycleMeasures[FloatArray]):
    """The results of the n points of a study, in the order of its plan; SI units.

    All arrays have shape (n,); the turning points are a list. NaN or None marks a value that does
    not exist, such as the period of a motion at rest, and a point that is not computed yet.
    """

    plan: Plan
    """The points of the study."""
    done: npt.NDArray[np.bool_]
    """Whether the point is computed."""
    cycles: npt.NDArray[np.intp]
    """Number of cycles that the measures are means of."""
    regime: npt.NDArray[np.object_]
    """The `Regime`, or None."""
    steady: npt.NDArray[np.bool_]
    """Whether the motion has settled."""
    turning_points: list[tuple[float, ...]]
    """Poincare section x' = 0 of each point, m."""
    reason: npt.NDArray[np.object_]
    """Why a point has no cycle to measure, or how it drifts, in words, or None."""

    @classmethod
    def of(cls, plan: Plan) -> Self:
        """Return the columns of a plan of which no point is computed.

        Parameters
        ----------
        plan : Grid or RandomSample
            The points of the study.
        """
        size = plan.size
        return cls(
            *(np.full(size, np.nan) for _ in quantities_of(CycleMeasures)),
            plan=plan,
            done=np.zeros(size, dtype=bool),
            cycles=np.zeros(size, dtype=np.intp),
            regime=np.full(size, None, dtype=object),
            steady=np.zeros(size, dtype=bool),
            turning_points=[()] * size,
            reason=np.full(size, None, dtype=object),
        )

    @cached_property
    def values(self) -> Mapping[str, FloatArray]:
        """Values of each varied parameter, by NODE.PARAMETER."""
        rows = np.array([self.plan.values(row) for row in range(self.plan.size)], dtype=float)
        return dict(zip(self.plan.parameters, rows.T, strict=True))

    def enter(self, points: Iterable[Point]) -> None:
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

    def points(self) -> Iterator[Point]:
        """Yield the points that are computed, in their order."""
        rows = zip(self.done, *map(self.cells, COLUMNS), strict=True)
        return (Point(number, *cells) for number, (done, *cells) in enumerate(rows) if done)


def write_csv(stream: TextIO, columns: Columns, further: Mapping[str, Any]) -> None:
    """Write a row for each point, with turning points separated by spaces.

    Arrays of `further` columns, by name, stand before the measures.
    """
    plan = columns.plan
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*plan.parameters, *further, *COLUMNS])
    more = (each.tolist() for each in further.values())
    rows = zip(*more, *map(columns.cells, COLUMNS), strict=True)
    for number, (*cells, turning_points, reason) in enumerate(rows):
        section = " ".join(map(repr, turning_points))
        writer.writerow([*plan.values(number), *cells, section, reason])


def json_entries(study: Study, columns: Columns, further: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters, their values, and the columns for JSON; arrays are iterators.

    For a grid, `values` has a list for each axis, and the arrays are row-major over the axes; if
    it has a continuation, the direction is the slowest index. Otherwise `values` has the
    parameters' values of each point.
    """
    plan = study.plan
    values: Iterator[Any] = map(plan.values, range(plan.size))
    if isinstance(plan, Grid):
        values = ([*map(axis.value, range(axis.count))] for axis in plan.axes)
    return {
        **{name: found for name, found in study.as_dict().items() if name != "scenario"},
        "parameters": plan.parameters,
        "values": values,
        **{name: iter(cells.tolist()) for name, cells in further.items()},
        **{name: columns.cells(name) for name in COLUMNS},
    }
