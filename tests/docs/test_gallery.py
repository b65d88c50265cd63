"""examples/, docs/gallery.md and docs/controllers.md: figures and values are those of today."""

import json
import runpy
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import nbformat
import pytest

from tests.docs.page import CHECKOUT

EXAMPLES = CHECKOUT / "examples"
PAGE = (CHECKOUT / "docs/gallery.md").read_text(encoding="utf-8")
GALLERY = CHECKOUT / "docs/gallery"
WITHOUT_FIGURE = {"foresight", "plc_export", "velocity_feedback"}
SCRIPTS = sorted(
    path.stem
    for path in EXAMPLES.glob("*.py")
    if path.stem not in WITHOUT_FIGURE and not path.stem.startswith("test_")
)
NOTEBOOKS = sorted(path.stem for path in EXAMPLES.glob("notebooks/*.ipynb"))
QUICK = {"replay_into_a_controller"}
ELSEWHERE = {"compare_controllers"}  # test_controllers.py


def test_there_are_as_many_as_the_page_says() -> None:
    assert (len(SCRIPTS), len(WITHOUT_FIGURE), len(NOTEBOOKS)) == (18, 3, 3)
    assert "Eighteen scripts, two controllers and three notebooks" in PAGE


@pytest.mark.parametrize(
    "script",
    [
        script if script in QUICK else pytest.param(script, marks=pytest.mark.long)
        for script in sorted(set(SCRIPTS) - ELSEWHERE)
    ],
)
def test_a_script_writes_its_figure(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [script, str(tmp_path)])
    runpy.run_path(str(EXAMPLES / f"{script}.py"), run_name="__main__")
    assert (tmp_path / f"{script}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
@pytest.mark.process
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_has_the_outputs_of_its_run(name: str) -> None:
    gallery = runpy.run_path(str(CHECKOUT / "docs/gallery.py"))
    path = EXAMPLES / "notebooks" / f"{name}.ipynb"
    kept, now = (
        [(sorted(data), data.get("text/plain")) for data in gallery["results_in"](notebook)]
        for notebook in (nbformat.read(path, as_version=4), gallery["executed"](path))
    )
    assert kept == now


def test_notebooks_are_kept_with_outputs_and_a_figure() -> None:
    for name in NOTEBOOKS:
        path = EXAMPLES / f"notebooks/{name}.ipynb"
        code = [cell for cell in json.loads(path.read_text())["cells"] if "outputs" in cell]
        outputs = [output for cell in code for output in cell["outputs"]]
        assert [cell["execution_count"] for cell in code] == [*range(1, len(code) + 1)]
        assert "error" not in {output["output_type"] for output in outputs}
        assert any("image/png" in output.get("data", {}) for output in outputs)
        assert path.stat().st_size < 300_000


def test_examples_are_in_the_gallery_with_a_small_figure() -> None:
    for name in (*SCRIPTS, *NOTEBOOKS):
        assert f"](gallery/{name}.png)" in PAGE
        assert (GALLERY / f"{name}.png").stat().st_size < 60_000


def test_scripts_say_what_they_show_and_are_short() -> None:
    for script in SCRIPTS:
        lines = (EXAMPLES / f"{script}.py").read_text(encoding="utf-8").splitlines()
        assert lines[0].startswith('"""')
        assert len(lines) <= 80, script


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
