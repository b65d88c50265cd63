"""examples/ and docs/gallery.md: each example runs, and has its figure on the page."""

import json
import runpy
import sys
from pathlib import Path

import pytest

from tests.docs.page import CHECKOUT

EXAMPLES = CHECKOUT / "examples"
PAGE = (CHECKOUT / "docs/gallery.md").read_text(encoding="utf-8")
GALLERY = CHECKOUT / "docs/gallery"
NODES = {"velocity_feedback", "foresight"}
SCRIPTS = sorted(
    path.stem
    for path in EXAMPLES.glob("*.py")
    if path.stem not in NODES and not path.stem.startswith("test_")
)
NOTEBOOKS = sorted(path.stem for path in EXAMPLES.glob("notebooks/*.ipynb"))
# Those that read a bag or only simulate a little; the others take several seconds each.
QUICK = {"position_servo", "read_a_bag", "replay_into_a_controller", "simulate_and_plot"}
ELSEWHERE = {"compare_controllers"}  # test_controllers.py


def run(script: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [script, str(folder)])
    runpy.run_path(str(EXAMPLES / f"{script}.py"), run_name="__main__")
    assert (folder / f"{script}.png").read_bytes().startswith(b"\x89PNG")


def test_there_are_as_many_as_the_page_says() -> None:
    assert (len(SCRIPTS), len(NODES), len(NOTEBOOKS)) == (19, 2, 3)
    assert "Nineteen scripts, two controllers and three notebooks" in PAGE


@pytest.mark.parametrize("script", sorted(QUICK))
def test_a_quick_script_writes_its_figure(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(script, tmp_path, monkeypatch)


@pytest.mark.long
@pytest.mark.parametrize("script", sorted(set(SCRIPTS) - QUICK - ELSEWHERE))
def test_a_script_writes_its_figure(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(script, tmp_path, monkeypatch)


@pytest.mark.long
@pytest.mark.process
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_runs_and_shows_a_figure(name: str) -> None:
    gallery = runpy.run_path(str(CHECKOUT / "docs/gallery.py"))
    executed = gallery["executed"](EXAMPLES / "notebooks" / f"{name}.ipynb")
    assert gallery["figures_in"](executed)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_kept_without_outputs(name: str) -> None:
    notebook = json.loads((EXAMPLES / f"notebooks/{name}.ipynb").read_text(encoding="utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


@pytest.mark.parametrize("name", [*SCRIPTS, *NOTEBOOKS])
def test_an_example_is_in_the_gallery_with_a_small_figure(name: str) -> None:
    assert f"](gallery/{name}.png)" in PAGE
    assert (GALLERY / f"{name}.png").stat().st_size < 60_000


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_script_says_what_it_shows_and_is_short(script: str) -> None:
    lines = (EXAMPLES / f"{script}.py").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith('"""')
    assert len(lines) <= 80
