"""docs/controllers.md: the values on it are those of the example."""

import json
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from tests.docs.page import CHECKOUT

KEPT = json.loads((CHECKOUT / "docs/gallery/comparison.json").read_text(encoding="utf-8"))


@pytest.fixture
def compare(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(CHECKOUT / "examples")
    yield import_module("compare_controllers")
    for module in ("compare_controllers", "velocity_feedback"):
        del sys.modules[module]


@pytest.mark.long
def test_the_kept_values_are_those_of_today(compare: ModuleType, tmp_path: Path) -> None:
    compare.main(tmp_path)
    assert (tmp_path / "compare_controllers.png").stat().st_size > 0
    today = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))
    assert len(today) == len(KEPT) == len(compare.BELT_SPEEDS) * len(compare.CONTROLLERS)
    for found, row in zip(today, KEPT, strict=True):
        assert found.keys() == row.keys()
        for name, value in row.items():
            close = pytest.approx(value, rel=1e-6, abs=1e-8) if isinstance(value, float) else value
            assert found[name] == close, (row["belt_speed"], row["controller"], name)
