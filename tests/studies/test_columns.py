"""Columns and tables are read back bit for bit."""

import csv
import json
from collections.abc import Iterator
from functools import partial
from io import StringIO
from math import nan
from typing import Any

import numpy as np
import pytest

from stickslip_ros.measures.cycle_measures import CycleMeasures
from stickslip_ros.quantities import quantities_of
from stickslip_ros.studies.columns import COLUMNS, Columns, Point, json_entries, write_csv
from stickslip_ros.studies.plan import Axis, Continuation, Grid, RandomSample
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.studies.study import Study, compute
from tests.studies.studies import SHORT, free, speeds

MINIMUM = Axis("plant.friction.minimum", 0.1, 0.6, 4)
SPEED = Axis("plant.belt_speed", 0.0, 0.6, 5)
SLOPE = Axis("plant.friction.slope", 0.3, 0.9, 3)
STARTS = (Axis("plant.initial.position", -1.0, 1.0, 2), Axis("plant.initial.velocity", 0.0, 1.0, 2))

STUDIES = {
    "both ways": Study(free(), Grid((MINIMUM, SPEED), Continuation.BOTH), SHORT),
    "sample": Study(free(), RandomSample(STARTS, 9, 4), SHORT),
    "running away": Study(
        free("plant.friction.law=linear", "plant.belt_speed=0.2"),
        Grid((SLOPE,)),
        SettlingOptions(40.0, 2),
    ),
}


@pytest.fixture(params=STUDIES, scope="module")
def study(request: pytest.FixtureRequest) -> Study:
    return STUDIES[request.param]


@pytest.fixture(scope="module")
def columns(study: Study) -> Columns:
    return compute_columns(study)


one_of = partial(pytest.mark.parametrize, "study", indirect=True)

NUMBERS = [*quantities_of(CycleMeasures)]


def bits(values: Any) -> list[bytes]:
    """Return the bytes of each number, which of two NaN are the same too."""
    return [np.float64(nan if value in (None, "") else value).tobytes() for value in values]


def test_columns_are_the_points_in_their_order(study: Study, columns: Columns) -> None:
    chains = study.plan.chains()
    points = sorted(point for chain in chains for point in compute(study, chain, None).points)
    assert len(points) == study.plan.size
    rows = [study.plan.values(number) for number in range(len(points))]
    for place, parameter in enumerate(study.plan.parameters):
        assert columns.values[parameter].tolist() == [row[place] for row in rows]
    assert list(columns.points()) == points


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is not JSON")


def as_json(
    study: Study, columns: Columns, further: dict[str, Any] | None = None, **provenance: Any
) -> dict[str, Any]:
    described = study.as_dict() | {"scenario": None} | provenance
    entries = described | json_entries(columns, further or {})
    values = {name: [*v] if isinstance(v, Iterator) else v for name, v in entries.items()}
    return json.loads(json.dumps(values), parse_constant=refuse)


def test_a_table_read_back_is_the_columns_to_the_last_bit(study: Study, columns: Columns) -> None:
    plan = study.plan
    further = {"twice": np.arange(0, 2 * plan.size, 2)}
    write_csv(stream := StringIO(), columns, further)
    lines = csv.DictReader(StringIO(stream.getvalue()))
    rows, read = list(lines), as_json(study, columns, further)
    assert lines.fieldnames == [*plan.parameters, "twice", *COLUMNS]
    assert len(rows) == plan.size
    for name in (*NUMBERS, "cycles"):
        found = bits(getattr(columns, name))
        assert bits(row[name] for row in rows) == bits(read[name]) == found, name
    for parameter in plan.parameters:
        assert bits(row[parameter] for row in rows) == bits(columns.values[parameter])
    assert [row["regime"] or None for row in rows] == read["regime"] == columns.regime.tolist()
    assert [row["steady"] == "True" for row in rows] == read["steady"] == columns.steady.tolist()
    assert [row["reason"] or None for row in rows] == read["reason"] == columns.reason.tolist()
    assert [int(row["twice"]) for row in rows] == read["twice"] == [*further["twice"]]
    for row, section, points in zip(
        rows, read["turning_points"], columns.turning_points, strict=True
    ):
        assert bits(row["turning_points"].split()) == bits(section) == bits(points)


@one_of(["both ways"])
def test_of_a_grid_there_are_the_values_of_its_axes(study: Study, columns: Columns) -> None:
    read = as_json(study, columns, scenario={"plant.mass": 1.0})
    assert read["parameters"] == ["plant.friction.minimum", "plant.belt_speed"]
    assert read["values"] == [MINIMUM.values().tolist(), SPEED.values().tolist()]
    assert read["scenario"] == {"plant.mass": 1.0}
    assert read["plan"]["carry"] == "both"
    assert read["course"] == {"transient": 5.0, "cycles": 2, "patience": 1, "extensions": 4}
    assert read["continuous_control"] is False


@one_of(["sample"])
def test_of_a_sample_there_are_the_values_of_each_point(study: Study, columns: Columns) -> None:
    read, plan = as_json(study, columns), study.plan
    assert read["parameters"] == ["plant.initial.position", "plant.initial.velocity"]
    assert [tuple(values) for values in read["values"]] == [plan.values(row) for row in range(9)]
    assert read["plan"]["kind"] == "sample"
    assert read["plan"]["seed"] == 4


def test_any_reason_is_read_back() -> None:
    reason = 'a, "b"\n c; \u00e4'
    study = speeds(2)
    columns = Columns.empty(study.plan)
    columns.enter(Point(number, reason=reason) for number in (0, 1))
    read = as_json(study, columns)
    write_csv(stream := StringIO(), columns, {})
    rows = list(csv.DictReader(StringIO(stream.getvalue(), newline="")))
    assert read["reason"] == [row["reason"] for row in rows] == [reason] * 2
