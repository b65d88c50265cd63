"""Paper on paper: the table of docs/identification.md.

J. Colas et al., Physical Review E, 2019.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from benchmarks import paper_on_paper as study

_FOUND = json.loads(
    (Path(study.__file__).parent / "paper_on_paper.json").read_text(encoding="utf-8")
)


def _rows(law: str) -> list[Mapping[str, Any]]:
    return [row for row in _FOUND["rows"] if row["law"] == law]


def _compare(row: Mapping[str, Any], found: study.Features) -> None:
    for name, value in asdict(found).items():
        expected = pytest.approx(row[name], rel=1e-3) if isinstance(value, float) else row[name]
        assert value == expected, name


@pytest.mark.process
@pytest.mark.skipif(not study.DATA.exists(), reason="the recorded data are not here")
def test_the_slips_of_the_records() -> None:
    for row in _rows("measured"):
        _compare(row, study.measured(row["stiffness"], row["speed"]))


@pytest.mark.parametrize("law", study.LAWS)
def test_what_a_fitted_law_predicts(law: str) -> None:
    friction = study.LAWS[law].make(*_FOUND["constants"][law].values())
    periods = {(row["stiffness"], row["speed"]): row["period"] for row in _rows("measured")}
    for row in _rows(law)[1:]:  # the slowest record is simulated for 40 s
        place = row["stiffness"], row["speed"]
        _compare(row, study.simulated(friction, *place, periods[place]))
