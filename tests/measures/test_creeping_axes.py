"""Creeping axes as drives record them: what a report tells is right, or not told."""

import json
from pathlib import Path

import pytest

from benchmarks import creeping_axes as study

COMMITTED = json.loads((Path(study.__file__).parent / "creeping_axes.json").read_text())


def test_the_committed_study_has_no_wrong_report() -> None:
    assert COMMITTED["axes"] == study.AXES
    assert study.shortfalls(COMMITTED) == []


@pytest.mark.parametrize(
    "number", [2, *(pytest.param(each, marks=pytest.mark.long) for each in (0, 1, 3, 4, 5))]
)
def test_a_part_of_the_study_agrees_with_it(number: int) -> None:
    reading = study.READINGS[number % 3]
    expected = COMMITTED["others"].get(f"{number} ({study.KINDS[number % 6]}), {reading}", "right")
    assert study.reported(number, [reading]) == {reading: expected}
