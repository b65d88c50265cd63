"""benchmarks/agreement.json: what `python -m benchmarks.agreement` has found."""

import json
from pathlib import Path
from typing import Any

from benchmarks import agreement
from benchmarks.random_drives import KINDS, LAWS, PLACES

FOUND: dict[str, Any] = json.loads(
    (Path(agreement.__file__).parent / "agreement.json").read_text(encoding="utf-8")
)


def test_thirty_drives_of_each_law_and_each_course_agree() -> None:
    assert set(FOUND["by_law_and_kind"]) == {f"{law}, {kind}" for law in LAWS for kind in KINDS}
    assert set(FOUND["by_place"]) == set(PLACES)
    for row in [*FOUND["by_law_and_kind"].values(), *FOUND["by_place"].values()]:
        assert row["drives"] >= 30
        assert row["agree"] == row["compared"]
        assert max(row["worst_error"], row["worst_event_error"]) < FOUND["required"] == 1e-7
    assert FOUND["differing"] == []
    uncompared = FOUND["all"]["drives"] - FOUND["all"]["compared"]
    assert len(FOUND["reference_not_accurate"]) == uncompared < 0.01 * FOUND["all"]["drives"]
