"""The command that compares control laws."""

import csv
import json
from pathlib import Path

from tests.app.conftest import Run

QUICK = ("--controllers", "washout,velocity_feedback", "--given", "washout", "--duration", "0.6")
STEP = ("--disturbances", "step", "--seeds", "2", "--spread", "0.1")


def test_it_prints_a_ranked_table_and_writes_all_cases(stickslip: Run, tmp_path: Path) -> None:
    out, page, figure = (tmp_path / name for name in ("cases.csv", "page.html", "figure.png"))
    files = ("--out", str(out), "--html", str(page), "--plot", str(figure))
    over = ("--over", "plant.belt_speed=0.03:0.04:2")
    done = stickslip("compare", "feed_drive", *QUICK, *STEP, *over, *files)
    assert done.returncode == 0, done.stderr
    assert "velocity_feedback  100.0% ± 0.0%" in done.stdout
    rows = list(csv.DictReader(out.open()))
    assert len(rows) == 2 * 2 * 2
    assert figure.stat().st_size > 10_000
    assert "Comparison of control laws" in page.read_text()
    assert not out.with_name("cases.csv.part").exists()


def test_json_has_the_ranks_with_their_constants_and_the_cases(stickslip: Run) -> None:
    done = stickslip("compare", "feed_drive", *QUICK, *STEP, "--json")
    found = json.loads(done.stdout)
    assert found["task"] == "regulation"
    assert {rank["law"] for rank in found["ranks"]} == {"washout", "velocity_feedback"}
    assert found["ranks"][0]["constants"]["force_limit"] is None
    assert len(found["cases"]["held"]) == 4
