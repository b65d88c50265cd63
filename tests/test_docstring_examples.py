"""The examples in the package's docstrings run, and print what they show."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def modules() -> list[str]:
    files = sorted((ROOT / "stickslip_ros").rglob("*.py"))
    with_examples = [file for file in files if ">>> " in file.read_text(encoding="utf-8")]
    return [".".join(file.relative_to(ROOT).with_suffix("").parts) for file in with_examples]


@pytest.mark.parametrize("module", modules())
def test_examples_of_docstrings_run(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    examples = import_module(module.removesuffix(".__init__"))
    result = doctest.testmod(examples, optionflags=doctest.ELLIPSIS)
    assert result.attempted > 0
    assert result.failed == 0
