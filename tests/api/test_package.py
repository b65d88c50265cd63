"""The names that `import stickslip_ros as ss` offers, and its cost."""

import ast
import importlib.metadata
from importlib import import_module
from pathlib import Path

import pytest

import stickslip_ros as ss

SOURCE = Path(__file__).parents[2]


def test_a_type_checker_sees_the_same_names_from_the_same_places() -> None:
    tree = ast.parse((SOURCE / "stickslip_ros" / "__init__.py").read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If) and "TYPE" in ast.dump(node))
    seen = {"__version__"}
    for node in block.body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                assert getattr(import_module(node.module or ""), alias.name) is getattr(
                    ss, alias.name
                )
                seen.add(alias.name)
    assert seen == set(ss.__all__)


def test_what_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'stickslip_ros' has no attribute 'nothing'"):
        _ = ss.nothing  # pyright: ignore


def test_it_shows_no_names_but_the_public_ones() -> None:
    assert dir(ss) == sorted(ss.__all__)
    assert ss.__version__ == importlib.metadata.version("stickslip_ros")
