"""docs/reliability.md: every guarantee names a test that exists."""

import ast
import re

import pytest

from tests.docs.page import CHECKOUT

PAGE = (CHECKOUT / "docs" / "reliability.md").read_text(encoding="utf-8")
ROWS = [
    [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in PAGE.splitlines()
    if line.startswith("|") and not re.match(r"\| *(guarantee|---)", line)
]


def exists(test: str) -> bool:
    """Whether a module of tests has a function of that name."""
    path, _, name = test.partition("::")
    if not (CHECKOUT / path).is_file():
        return False
    body = ast.parse((CHECKOUT / path).read_text(encoding="utf-8")).body
    return name in {node.name for node in body if isinstance(node, ast.FunctionDef)}


def test_the_page_has_guarantees() -> None:
    assert len(ROWS) > 50


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_a_guarantee_names_a_test_that_exists(row: list[str]) -> None:
    guarantee, meaning, test = row
    assert guarantee
    assert meaning
    assert re.fullmatch(r"`tests/[\w/]+\.py::test_\w+`", test), test
    assert exists(test.strip("`")), test


@pytest.mark.parametrize(
    "test",
    [
        "tests/docs/test_nothing.py::test_the_page_has_guarantees",
        "tests/docs/test_reliability.py::test_nothing",
        "tests/docs/test_reliability.py::",
        "tests/docs/test_reliability.py::exists.path",
    ],
)
def test_a_test_that_does_not_exist_is_noticed(test: str) -> None:
    assert not exists(test)
