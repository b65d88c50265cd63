"""`stickslip basin`: shares, tables, figures, and refusals."""

import csv
from collections import Counter
from collections.abc import Sequence
from math import sqrt
from pathlib import Path

import pytest

from stickslip_ros.app import output
from stickslip_ros.studies import runner
from stickslip_ros.studies import study as study_module
from stickslip_ros.studies.settling import MotionState
from stickslip_ros.studies.study import Piece, Study
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
RANGES = ("--position=-2:2:6", "--velocity=0:2:6")


@pytest.fixture
def drive(tmp_path: Path) -> str:
    (tmp_path / "drive.yaml").write_text(DRIVE)
    return "drive.yaml"


def test_the_shares_are_those_of_the_table(stickslip: Run, tmp_path: Path, drive: str) -> None:
    found = stickslip.json("basin", drive, *RANGES, "--out", "basin.csv", "--plot", "basin.png")
    with (tmp_path / "basin.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    counts = Counter(int(row["attractor"]) for row in rows)
    cycle, rest = found["attractors"]
    assert (cycle["regime"], rest["regime"]) == ("stick_slip", "equilibrium")
    assert [cycle["count"], rest["count"]] == [counts[0], counts[1]]
    assert cycle["share"] + rest["share"] == 1.0
    assert cycle["standard_error"] == pytest.approx(sqrt(cycle["share"] * rest["share"] / 36))
    assert cycle["amplitude"] == pytest.approx(1.57966, abs=1e-5)
    for row in rows:
        assert (row["regime"] == "stick_slip") == (row["attractor"] == "0")
    assert found["attractor"] == [int(row["attractor"]) for row in rows]
    assert (tmp_path / "basin.png").read_bytes().startswith(b"\x89PNG")


def test_a_long_one_says_what_would_be_quicker(
    stickslip: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(output, "_JUDGING_TIME", 0.0)
    monkeypatch.setattr(output, "_LONG_TIME", -1.0)
    starts = "--sample", "2", "--position=0:1e-4", "--velocity=0:1e-4", "--transient", "1"
    for command, advice in (
        ("", "; every sample is simulated: --continuous-control is several times as fast"),
        ("-p plant.sensor.position_resolution=5e-6", ""),
        ("-p plant.force_delay=0.001", ""),
        ("--continuous-control", ""),
        ("--no-control", ""),
    ):
        done = stickslip("basin", "feed_drive", *command.split(), *starts)
        assert done.returncode == 0
        assert f"basins of feed_drive, 2 starts: about 0 min more{advice}\n" in done.stderr


def test_interrupted_without_a_file_it_goes_on_from_the_cache(
    stickslip: Run,
    process_environment: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    process_environment["XDG_CACHE_HOME"] = str(tmp_path / "cache")
    command = "basin", "feed_drive", "--continuous-control", "--sample", "5"
    computed: list[int] = []

    def compute(study: Study, points: Sequence[int], start: MotionState | None) -> Piece:
        if len(computed) == 2:
            raise KeyboardInterrupt
        computed.extend(points)
        return study_module.compute(study, points[:], start)

    with monkeypatch.context() as patch:
        patch.setattr(runner, "_task_size", lambda journal, in_flight: 1)
        patch.setattr(runner, "compute", compute)
        stopped = stickslip(*command)
    assert stopped.returncode == 130
    (part,) = (tmp_path / "cache/stickslip_ros").iterdir()
    assert f"2 of 5 points are done; they stay in {part}, and the same command" in stopped.stderr
    again = stickslip(*command)
    assert again.returncode == 0
    assert f"2 points are taken from {part}" in again.stderr
    assert not part.exists()
    whole = stickslip(*command)
    assert (whole.stdout, whole.stderr) == (again.stdout, "")
    (tmp_path / "cache/stickslip_ros").rmdir()
    (tmp_path / "cache/stickslip_ros").write_text("no directory")
    assert stickslip(*command).stdout == whole.stdout
