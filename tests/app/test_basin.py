"""`stickslip basin`: shares, tables, figures, and refusals."""

import csv
import json
from collections import Counter
from math import sqrt
from pathlib import Path

import pytest

from tests.app.conftest import Run

# Rest and stick-slip are both stable (see tests/studies/test_basin.py).
DRIVE = """
/**/plant:
  ros__parameters:
    damping: 0.1
    belt_speed: 1.5
    expects_control: false
    friction: {law: exponential, static: 1.0, kinetic: 0.5, decay_speed: 0.5, viscous: 0.0}
"""
RANGES = ("--position=-2:2:12", "--velocity=0:2:12")


@pytest.fixture
def drive(tmp_path: Path) -> str:
    (tmp_path / "drive.yaml").write_text(DRIVE)
    return "drive.yaml"


def test_the_shares_are_those_of_the_table(stickslip: Run, tmp_path: Path, drive: str) -> None:
    tables = ("--out", "basin.csv", "--plot", "basin.png", "--json")
    done = stickslip("basin", drive, *RANGES, *tables)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    with (tmp_path / "basin.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    counts = Counter(int(row["attractor"]) for row in rows)
    cycle, rest = found["attractors"]
    assert (cycle["regime"], rest["regime"]) == ("stick_slip", "equilibrium")
    assert [cycle["count"], rest["count"]] == [counts[0], counts[1]]
    assert cycle["share"] + rest["share"] == 1.0
    assert cycle["standard_error"] == pytest.approx(sqrt(cycle["share"] * rest["share"] / 144))
    assert cycle["amplitude"] == pytest.approx(1.57966, abs=1e-5)
    for row in rows:
        assert (row["regime"] == "stick_slip") == (row["attractor"] == "0")
    assert found["attractor"] == [int(row["attractor"]) for row in rows]
    assert (tmp_path / "basin.png").read_bytes().startswith(b"\x89PNG")


def test_a_sample_is_the_same_each_time_and_another_with_another_seed(
    stickslip: Run, drive: str
) -> None:
    def starts(*arguments: str) -> list[list[float]]:
        sample = ("--position", "-2:2", "--velocity", "0:2", "--sample", "6", "--json")
        done = stickslip("basin", drive, *sample, *arguments)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)["values"]

    first = starts()
    assert first == starts("--seed", "0")
    assert first != starts("--seed", "1")
    assert all(-2.0 <= position <= 2.0 and 0.0 <= speed <= 2.0 for position, speed in first)


def test_without_ranges_the_starts_are_around_the_equilibrium(stickslip: Run) -> None:
    done = stickslip(
        "basin", "paper", "--no-control", "--sample", "20", "-p", "plant.belt_speed=0.6"
    )
    assert done.returncode == 0, done.stderr
    for text in ("paper, 20 starts", "equilibrium", "20", "1.0000", "0.0000"):
        assert text in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--position=1:2"], "--position=1:2: must be A:B:COUNT"),
        (["--velocity=a:b:3"], "--velocity=a:b:3: "),
        (["--position=1:2:3:4"], "--position=1:2:3:4: must be A:B:COUNT"),
        (["--seed", "1"], "--seed 1: is for a random --sample"),
        (["--sample", "0"], "0 points: must be from 1 to"),
        (["--sample", "9", "--seed", "-1"], "--seed -1: must be 0 or more"),
        (["--plot", "basin.txt"], "--plot basin.txt: must end in one of"),
    ],
)
def test_invalid_input_is_refused(stickslip: Run, arguments: list[str], message: str) -> None:
    done = stickslip("basin", "paper", "--no-control", *arguments)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
