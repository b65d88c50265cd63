"""`stickslip paper`: the report and the pictures, from the command line."""

import json
from pathlib import Path

import pytest

from tests.app.conftest import Run


@pytest.mark.long
def test_the_whole_paper(stickslip: Run, tmp_path: Path) -> None:
    done = stickslip("paper", "--out", "again", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert len(found["claims"]) > 100
    assert {claim["verdict"] for claim in found["claims"]} == {
        "holds", "holds with a correction", "does not hold", "not decidable"
    }  # fmt: skip
    out = tmp_path / "again"
    assert {"claims", "figures"} <= json.loads((out / "reproduction.json").read_text()).keys()
    page = (out / "reproduction.md").read_text(encoding="utf-8")
    pictures = sorted(out.glob("reproduction/*.png"))
    assert [picture.name for picture in pictures] == [f"figure_{n:02}.png" for n in range(2, 14)]
    for picture in pictures:
        assert f"(reproduction/{picture.name})" in page


@pytest.mark.parametrize("out", ["file", "file/below", "/proc/none/out"])
def test_a_directory_that_cannot_be_made(stickslip: Run, tmp_path: Path, out: str) -> None:
    (tmp_path / "file").write_text("precious")
    done = stickslip("paper", "--out", out)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert out in line
    assert (tmp_path / "file").read_text() == "precious"
