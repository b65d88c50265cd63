"""Random drives through an encoder: measures that agree with the motion within their errors."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from benchmarks import encoder_drives as study

COMMITTED = json.loads((Path(study.__file__).parent / "encoder_drives.json").read_text())


def test_the_deviations_of_the_committed_study_are_those_of_its_errors() -> None:
    counts = study.counts(COMMITTED["drives"])
    assert counts == COMMITTED["counts"]
    assert counts["drives"] == study.DRIVES
    assert counts["regimes"] == {"right": 59, "null": 1}
    assert all(drive["notes"] for drive in COMMITTED["drives"] if drive["regime"] is None)
    assert 0.92 <= counts["within 2 errors"] <= 0.98
    assert counts["within 3 errors"] >= 0.99


@pytest.mark.parametrize("number", [0, 6, pytest.param(1, marks=pytest.mark.long)])
def test_a_part_of_the_study_agrees_with_it(number: int) -> None:
    committed, found = COMMITTED["drives"][number], asdict(study.comparison(number))
    assert found["deviations"] == pytest.approx(committed["deviations"], abs=0.1)
    assert (found["regime"], found["rate"]) == (committed["regime"], committed["rate"])
