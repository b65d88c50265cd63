"""docs/controllers.md: the numbers on it are those of the examples."""

import json
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).parents[2] / "docs"
EXAMPLES = DOCS / "examples"
PAGE = (DOCS / "controllers.md").read_text(encoding="utf-8")


@pytest.fixture
def compare(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(EXAMPLES)
    yield import_module("compare")
    for module in ("compare", "velocity_feedback"):
        del sys.modules[module]


def test_the_table_on_the_page_is_that_of_the_kept_figures(compare: ModuleType) -> None:
    kept = json.loads((EXAMPLES / "comparison.json").read_text(encoding="utf-8"))
    assert compare.BEGIN + compare.table(kept) + compare.END in PAGE


@pytest.mark.long
def test_the_kept_figures_are_those_of_today(compare: ModuleType) -> None:
    kept = json.loads((EXAMPLES / "comparison.json").read_text(encoding="utf-8"))
    assert len(kept) == len(compare.BELT_SPEEDS) * len(compare.CONTROLLERS)
    for row in kept:
        case = row["belt_speed"], row["controller"]
        found = compare.figures(*case, compare.run(*case))
        assert found.keys() == row.keys()
        for name, value in row.items():
            close = pytest.approx(value, rel=1e-6, abs=1e-8) if isinstance(value, float) else value
            assert found[name] == close, (case, name)
