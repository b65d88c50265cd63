"""The points of a study as columns: in memory for a program, as a table in a file for the rest."""

import csv
import json
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryFile
from typing import Any, Self, TextIO

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.deprecated_names import Renamed
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Grid, Plan
from stickslip_ros.studies.runner import IN_FLIGHT, CountPoints, run, run_here
from stickslip_ros.studies.study import MEASURES, Point, Study

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

    of = Renamed("from_journal")

    @classmethod
    def from_journal(cls, journal: Journal) -> Self:
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

    def points(self) -> Iterator[Point]:
        """Yield the points, in their order."""
        columns = [getattr(self, name).tolist() for name in MEASURES]
        for number, values in enumerate(zip(*columns, strict=True)):
            measures: dict[str, Any] = {
                name: None if isinstance(value, float) and isnan(value) else value
                for name, value in zip(MEASURES, values, strict=True)
            }
            yield Point(
                number,
                Measures(**measures),
                bool(self.steady[number]),
                self.turning_points[number],
                self.reason[number],
            )


def compute_columns(
    study: Study,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    in_flight: int = IN_FLIGHT,
    path: Path | None = None,
    progress: CountPoints = lambda _: None,
) -> Columns:
    """Compute a study and return what became of its points.

    In this process, in several `workers` here, or through any `executor`, which then holds
    `in_flight` tasks at a time; all give the same. `path` is a journal, from which a study that was
    interrupted goes on, and which is there for the next time when it is done. `progress` is told
    how many points are done. Raises RunError if workers keep dying.

        scenario = load_scenario("paper", ["plant.expects_control=false"])
        study = sweep_study(scenario, [Axis("plant.belt_speed", 0.02, 0.6, 59)])
        found = compute_columns(study)
        sticks = found.regime == Regime.STICK_SLIP
        print(found.values["plant.belt_speed"][sticks].max())
    """
    with Journal(study, path) as journal:
        if executor is not None:
            run(journal, executor, in_flight=in_flight, progress=progress)
        else:
            run_here(journal, workers, progress)
        return Columns.from_journal(journal)


ExtraColumns = Mapping[str, Callable[[Point], Any]]
"""Columns of a table before the measures: their names, and what makes them of a point."""


def write_csv(stream: TextIO, journal: Journal, further: ExtraColumns) -> None:
    """Write a row for each point that is done; turning points are separated by spaces."""
    plan = journal.study.plan
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*plan.parameters, *further, *COLUMNS])
    for point in journal.points():
        cells = [*plan.values(point.number), *(make(point) for make in further.values())]
        *measures, turning_points, reason = point.as_json()[1:]
        writer.writerow([*cells, *measures, " ".join(map(repr, turning_points)), reason])


def write_json(
    stream: TextIO, journal: Journal, further: ExtraColumns, made_of: Mapping[str, Any]
) -> None:
    """Write one object: the parameters, their values, and an array for each column.

    Of a grid, `values` has a list for each axis and the arrays are row-major over the axes, and
    over the directions before, if it is carried on; otherwise `values` has the parameters' values
    of each point. `made_of`, ready for JSON, is written besides. The arrays pass through files:
    memory is for one piece of the study.
    """
    study = journal.study
    plan = study.plan
    how = {name: found for name, found in study.as_dict().items() if name != "scenario"}
    stream.write("{\n")
    for name, value in {**made_of, **how, "parameters": plan.parameters}.items():
        stream.write(f' "{name}": {json.dumps(value, allow_nan=False)},\n')
    makers: dict[str, Callable[[Point], Any]] = dict(further)
    if isinstance(plan, Grid):
        _write_values(stream, plan)
    else:
        makers = {"values": lambda point: plan.values(point.number), **further}
    names = [*makers, *COLUMNS]
    with ExitStack() as stack:
        files = {name: stack.enter_context(TemporaryFile("w+")) for name in names}
        separator = ""
        for point in journal.points():
            cells = [*(make(point) for make in makers.values()), *point.as_json()[1:]]
            for file, cell in zip(files.values(), cells, strict=True):
                file.write(f"{separator}{json.dumps(cell)}")
            separator = ", "
        for name, file in files.items():
            file.seek(0)
            stream.write(f' "{name}": [')
            copyfileobj(file, stream)
            stream.write("],\n" if name != names[-1] else "]\n")
    stream.write("}\n")


def _write_values(stream: TextIO, grid: Grid) -> None:
    """Write the values of each axis, one at a time."""
    stream.write(' "values": [')
    for place, axis in enumerate(grid.axes):
        stream.write(", [" if place else "[")
        for number in range(axis.count):
            stream.write(f"{', ' if number else ''}{json.dumps(axis.value(number))}")
        stream.write("]")
    stream.write("],\n")
