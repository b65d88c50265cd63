"""The names that `import stickslip_ros as ss` offers, and its cost."""

import ast
import importlib.metadata
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import stickslip_ros as ss

SOURCE = Path(__file__).parents[2]


def loaded_after(code: str) -> set[str]:
    """Return the packages that a fresh process has loaded after running `code`."""
    script = f"{code}\nimport sys; print(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=SOURCE, capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


@pytest.mark.process
def test_results_load_what_draws_and_tabulates_when_asked() -> None:
    loaded = loaded_after("import stickslip_ros as ss; ss.simulate('paper', duration=1)")
    assert not {"matplotlib", "rclpy", "pandas", "xarray"} & loaded
    assert "heyoka" in loaded


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
