"""docs/theory.md: the files that it names exist."""

import re

import pytest

from tests.docs.page import CHECKOUT, spans

PHYSICS = CHECKOUT / "stickslip_ros" / "physics"
NAMED = sorted({s for s in spans("docs/theory.md") if re.search(r"\.py$|\w/$", s)})


def test_the_page_names_files() -> None:
    assert "model/equations.py" in NAMED


@pytest.mark.parametrize("path", [path for path in NAMED if not path.startswith("stickslip_ros/")])
def test_a_file_that_is_named_exists(path: str) -> None:
    assert (PHYSICS / path).exists()
