"""docs/troubleshooting.md: the messages that it quotes are messages of the package."""

import ast
import re
from functools import cache

import pytest

from tests.docs.page import CHECKOUT

PAGE = (CHECKOUT / "docs/troubleshooting.md").read_text(encoding="utf-8")
FIRST_CELLS = re.findall(r"^\| ([^|]*) \|", PAGE, re.MULTILINE)
# In the first column, what is no message of ours.
OTHERS = r"ros2|1e6|late_forces|workers"
MESSAGES = [
    quoted
    for cell in FIRST_CELLS
    for quoted in re.findall("`([^`]+)`", cell)
    if not re.match(OTHERS, quoted)
]


@cache
def texts() -> list[str]:
    """Texts in the package, with … for what is filled in, and the Makefile."""
    found = [(CHECKOUT / "Makefile").read_text(encoding="utf-8")]
    for file in (CHECKOUT / "stickslip_ros").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            parts = node.values if isinstance(node, ast.JoinedStr) else [node]
            found.append(
                "".join(
                    part.value
                    if isinstance(part, ast.Constant) and isinstance(part.value, str)
                    else "…"
                    for part in parts
                )
            )
    return found


def test_there_are_messages() -> None:
    assert len(MESSAGES) > 10


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_that_is_quoted_is_one_of_ours(message: str) -> None:
    pieces = [re.escape(piece.strip()) for piece in message.split("…") if piece.strip()]
    assert any(re.search(".*".join(pieces), text) for text in texts()), message
