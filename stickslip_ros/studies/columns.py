"""The points of a study as columns: in memory for a program, as a table in a file for the rest."""

import csv
import json
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from shutil import copyfileobj
from tempfile import TemporaryFile
from typing import Any, Self, TextIO

import numpy as np
import numpy.typing as npt

from stickslip_ros.physics.knots import FloatArray
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Carry, Grid, Plan
from stickslip_ros.studies.study import MEASURES, Point

COLUMNS = (*MEASURES, "steady", "turning_points", "reason")
"""What a table has of each point, besides the values of the parameters."""


@dataclass(frozen=True)
class Columns:
    """What became of the n points of a study, in the order of its plan; SI units.

    NaN or None stands for what does not exist, such as the period of a motion that has none, and
    for points that are not done.
    """

    plan: Plan
    values: Mapping[str, FloatArray]
    """Of each parameter that varies, by NODE.PARAMETER; arrays of n."""
    amplitude: FloatArray
    """m"""
    velocity_amplitude: FloatArray
    """m/s"""
    midpoint: FloatArray
    """m"""
    period: FloatArray
    """s"""
    frequency: FloatArray
    """Hz"""
    stick_fraction: FloatArray
    cycles: npt.NDArray[np.intp]
    """How many the measures are means over."""
    regime: npt.NDArray[np.object_]
    """A `Regime` or None."""
    steady: npt.NDArray[np.bool_]
    """Whether the motion has settled (see `studies.settled`)."""
    turning_points: tuple[tuple[float, ...], ...]
    """Poincare section x' = 0 of each point, m."""
    reason: npt.NDArray[np.object_]
    """Why a point has no cycle to measure, in words, or None."""

    @classmethod
    def of(cls, journal: Journal) -> Self:
        """Return what a journal holds."""
        plan = journal.study.plan
        count = plan.size
        numbers: dict[str, Any] = {name: np.full(count, np.nan) for name in MEASURES}
        numbers["cycles"] = np.zeros(count, dtype=np.intp)
        numbers["regime"] = np.full(count, None, dtype=object)
        reason = np.full(count, None, dtype=object)
        steady = np.zeros(count, dtype=bool)
        turning_points: list[tuple[float, ...]] = [()] * count
        for point in journal.points():
            row = point.number
            for name, column in numbers.items():
                column[row] = getattr(point.measures, name)
            steady[row], reason[row] = point.steady, point.reason
            turning_points[row] = point.turning_points
        values = np.array([plan.values(row) for row in range(count)], dtype=float).T
        return cls(
            plan=plan,
            values=dict(zip(plan.parameters, values, strict=True)),
            **numbers,
            steady=steady,
            turning_points=tuple(turning_points),
            reason=reason,
        )


def write_csv(stream: TextIO, journal: Journal) -> None:
    """Write a row for each point that is done; turning points are separated by spaces."""
    plan = journal.study.plan
    directions = ["direction"] if plan.carried else []
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*plan.parameters, *directions, *COLUMNS])
    for point in journal.points():
        direction = [str(_direction(plan, point.number))] if plan.carried else []
        *rest, turning_points, reason = _cells(point)
        section = " ".join(map(repr, turning_points))
        writer.writerow([*plan.values(point.number), *direction, *rest, section, reason])


def write_json(stream: TextIO, journal: Journal, made_of: Mapping[str, Any]) -> None:
    """Write one object: the parameters, their values, and an array for each column.

    Of a grid, `values` has a list for each axis and the arrays are row-major over the axes, and
    over `directions` before, if it is carried on; otherwise `values` too has one entry for each
    point. `made_of`, ready for JSON, is written besides. The arrays pass through files: memory is
    for one piece of the study.
    """
    study = journal.study
    plan = study.plan
    head: dict[str, Any] = {"parameters": list(plan.parameters)}
    if isinstance(plan, Grid):
        head["values"] = [axis.values().tolist() for axis in plan.axes]
        if plan.carried:
            head["directions"] = plan.directions
    else:
        head["values"] = list(zip(*map(plan.values, range(plan.size)), strict=True))
    head |= {"course": study.as_dict()["course"], "continuous_control": study.continuous, **made_of}
    stream.write("{\n")
    for name, value in head.items():
        stream.write(f' "{name}": {json.dumps(value)},\n')
    with ExitStack() as stack:
        files: dict[str, TextIO] = {}
        for name in COLUMNS:
            files[name] = stack.enter_context(TemporaryFile("w+"))
        separator = ""
        for point in journal.points():
            for file, cell in zip(files.values(), _cells(point), strict=True):
                file.write(f"{separator}{json.dumps(cell)}")
            separator = ", "
        for name, file in files.items():
            file.seek(0)
            stream.write(f' "{name}": [')
            copyfileobj(file, stream)
            stream.write("],\n" if name != COLUMNS[-1] else "]\n")
    stream.write("}\n")


def _cells(point: Point) -> list[Any]:
    return point.as_json()[1:]


def _direction(plan: Plan, number: int) -> Carry | None:
    return plan.direction(number) if isinstance(plan, Grid) else None
