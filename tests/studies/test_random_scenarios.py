"""What is said of a scenario does not depend on how it is asked."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import random_scenarios as benchmark
from tests.studies.random_scenarios import CHANGES, differences

FOUND: dict[str, Any] = json.loads(
    (Path(benchmark.__file__).parent / "random_scenarios.json").read_text(encoding="utf-8")
)


# One of each law; of LuGre friction seed 5 takes five times as long as seed 12.
@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3, 4, 12, 6))]
)
def test_no_change_alters_what_it_should_not(seed: int) -> None:
    assert {name: differences(seed, name) for name in CHANGES} == {name: [] for name in CHANGES}


def test_the_study_has_found_few_in_300_scenarios() -> None:
    """What counts of a drift follows the displacement, and of a slow rest the samples."""
    assert FOUND["scenarios"] == 300
    differing = {name: row["differing"] for name, row in FOUND["by_change"].items()}
    assert differing == dict.fromkeys(CHANGES, 0) | {"drawn": 1, "bias": 3, "rate": 4}
    assert len(FOUND["differing"]) == 8
    assert set(FOUND["regimes"]) >= {"stick_slip", "pure_slip", "equilibrium", "stuck"}
