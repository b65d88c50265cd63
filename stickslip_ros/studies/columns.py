"""The points of a study as columns: arrays in memory, or a table in a CSV or JSON file."""

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
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Grid, Plan
from stickslip_ros.studies.runner import IN_FLIGHT, CountPoints, run, run_here
from stickslip_ros.studies.study import MEASURES, Point, Study

COLUMNS = (*MEASURES, "steady", "turning_points", "reason")
"""Columns of a table, in addition to the values of the parameters."""


@dataclass(frozen=True)
class Columns:
    """The results of the n points of a study, in the order of its plan; SI units.

    All arrays have shape (n,). NaN or None marks a value that does not exist, such as the period of
    a motion at rest, and a point that is not computed yet.
    """

    plan: Plan
    """The points of the study."""
    values: Mapping[str, FloatArray]
    """Values of each varied parameter, by NODE.PARAMETER."""
    amplitude: FloatArray
    """Amplitude of the displacement, m."""
    velocity_amplitude: FloatArray
    """Amplitude of the velocity, m/s."""
    midpoint: FloatArray
    """Midpoint of the displacement, m."""
    period: FloatArray
    """Period of the limit cycle, s."""
    frequency: FloatArray
    """Frequency of the limit cycle, Hz."""
    stick_fraction: FloatArray
    """Share of the time in which the slide sticks, 0 to 1."""
    cycles: npt.NDArray[np.intp]
    """Number of cycles that the measures are means of."""
    regime: npt.NDArray[np.object_]
    """The `Regime`, or None."""
    steady: npt.NDArray[np.bool_]
    """Whether the motion has settled."""
    turning_points: tuple[tuple[float, ...], ...]
    """Poincare section x' = 0 of each point, m."""
    reason: npt.NDArray[np.object_]
    """Why a point has no cycle to measure, or how it drifts, in words, or None."""

    @classmethod
    def from_journal(cls, journal: Journal) -> Self:
        """Return the points of a journal as columns.

        Parameters
        ----------
        journal : Journal
            The journal; it need not be complete.

        Returns
        -------
        Columns
            One row for each point of the study's plan.
        """
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
    """Compute a study and return its points as columns.

    The result does not depend on how the work is shared.

    Parameters
    ----------
    study : Study
        The study, as from `sweep_study` or `basin_study`.
    workers : int
        Number of processes on this machine; 1 computes in this process.
    executor : concurrent.futures.Executor, optional
        Executor to use instead of `workers`.
    in_flight : int
        Number of tasks that the executor holds at a time.
    path : Path, optional
        Journal file. An interrupted study continues from it, and it is kept at the end. Without a
        path the journal is a temporary file.
    progress : Callable[[int], None]
        Receives the number of points that are done.

    Returns
    -------
    Columns
        The results, one row for each point.

    Raises
    ------
    InvalidInputError
        If `path` is not a journal of this study, or cannot be written.
    RunError
        If the worker processes keep dying, or the executor gives up.

    Examples
    --------
    >>> from stickslip_ros.physics.measures.cycle_measures import Regime
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> from stickslip_ros.studies.plan import Axis
    >>> from stickslip_ros.studies.sweep import sweep_study
    >>> scenario = load_scenario("paper", ["plant.expects_control=false"])
    >>> study = sweep_study(scenario, [Axis("plant.belt_speed", 0.1, 0.6, 6)])
    >>> found = compute_columns(study)
    >>> sticks = found.regime == Regime.STICK_SLIP
    >>> print(f"{found.values['plant.belt_speed'][sticks].max():.1f}")
    0.4
    """
    with Journal(study, path) as journal:
        if executor is not None:
            run(journal, executor, in_flight=in_flight, progress=progress)
        else:
            run_here(journal, workers, progress)
        return Columns.from_journal(journal)


ExtraColumns = Mapping[str, Callable[[Point], Any]]
"""Extra columns of a table, before the measures: their names, and a function of a point each."""


def write_csv(stream: TextIO, journal: Journal, further: ExtraColumns) -> None:
    """Write a row for each point that is done, with turning points separated by spaces."""
    plan = journal.study.plan
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*plan.parameters, *further, *COLUMNS])
    for point in journal.points():
        cells = [*plan.values(point.number), *(make(point) for make in further.values())]
        *measures, turning_points, reason = point.as_json()[1:]
        writer.writerow([*cells, *measures, " ".join(map(repr, turning_points)), reason])


def write_json(
    stream: TextIO, journal: Journal, further: ExtraColumns, provenance: Mapping[str, Any]
) -> None:
    """Write one object: the parameters, their values, and an array for each column.

    For a grid, `values` has a list for each axis, and the arrays are row-major over the axes; if
    it has a continuation, the direction is the slowest index. Otherwise `values` has the
    parameters' values of each point. The entries of `provenance`, ready for JSON, are added. The
    arrays pass through temporary files, so that memory holds one piece of the study only.
    """
    study = journal.study
    plan = study.plan
    how = {name: found for name, found in study.as_dict().items() if name != "scenario"}
    stream.write("{\n")
    for name, value in {**provenance, **how, "parameters": plan.parameters}.items():
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
