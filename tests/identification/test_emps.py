"""The ball-screw axis EMPS: published numbers, and those that docs/identification.md is made from.

A. Janot, M. Gautier, M. Brunot, Data set and reference models of EMPS, 2019.
"""

import json
import os
from pathlib import Path

import pytest

from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.identify import identify
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.recordings import read_records

_COLUMNS = {"time": "t", "position": "qm", "force": "vir*gtau", "reference": "qg"}
_FILE = Path(
    os.environ.get("STICKSLIP_DATA", Path(__file__).parents[3] / "shared" / "data"),
    "emps/DATA_EMPS.mat",
)
_STUDY = Path(__file__).parents[2] / "benchmarks" / "ball_screw_axis.json"

pytestmark = pytest.mark.process


@pytest.fixture(scope="module")
def record() -> Record:
    """The record."""
    if not _FILE.exists():
        pytest.skip(f"the recorded data are not here: {_FILE}")
    (found,) = read_records(_FILE, _COLUMNS)
    return found


@pytest.fixture(scope="module")
def table(record: Record) -> Findings:
    """The model that is chosen."""
    return identify([record])


def test_the_published_constants_by_direction(record: Record) -> None:
    found = identify([record], "coulomb")
    published = {
        "mass": 95.1540,
        "friction.static": 20.1440,
        "friction.viscous": 166.7061,
        "friction.reverse.static": 20.6277,
        "friction.reverse.viscous": 240.4236,
    }
    for name, value in published.items():
        assert found.fitted[name].value == pytest.approx(value, rel=1e-3), name
    assert found.force_error(record) == pytest.approx(0.0306, abs=0.0003)


@pytest.mark.long
def test_a_curve_is_chosen_that_predicts_better(record: Record, table: Findings) -> None:
    assert table.law == "table"
    assert table.chosen.error < 0.0265
    assert "coulomb" not in table.as_good  # its errors have structure over the speed
    check = table.check(record)
    assert check["position_error"] < 6.5e-6
    assert check["closed_loop_force_error"] < 0.03
    assert check["free_run_error"] < 2.0e-3
    for number in range(2):
        force = table.curves[number].force
        assert (force[1:] >= force[:-1]).all()
    documented = json.loads(_STUDY.read_text(encoding="utf-8"))["chosen"]
    mass = documented["parameters"]["plant.mass"]["value"]
    assert table.fitted["mass"].value == pytest.approx(mass, rel=1e-4)
    for name in ("force_error", "free_run_error", "position_error", "closed_loop_force_error"):
        assert check[name] == pytest.approx(documented[name], rel=0.01), name


@pytest.mark.long
def test_the_first_half_predicts_the_second(record: Record) -> None:
    half = len(record.position) // 2
    found = identify([record.part(0, half)], "table")
    own = found.check(record.part(0, half))
    other = found.check(record.part(half, 2 * half))
    assert other["force_error"] < 1.1 * own["force_error"]
    assert other["position_error"] < 1.1 * own["position_error"]
