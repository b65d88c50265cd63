"""`stickslip sweep` and `basin`: tables, figures, the time they take, and interruptions."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from stickslip_ros.app import output
from stickslip_ros.studies import runner
from stickslip_ros.studies import study as study_module
from stickslip_ros.studies.settling import MotionState
from stickslip_ros.studies.study import Piece, Study
from tests.app.conftest import Run


def test_a_table_that_came_meanwhile_is_left_alone_and_the_points_are_kept(
    stickslip: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table, whole = tmp_path / "table.csv", runner.run_here
    speeds = ("--over", "plant.belt_speed=0.2:0.6:3")
    sweep = ("sweep", "paper", "--no-control", *speeds, "--out", "table.csv")

    def run_here(*arguments: Any) -> None:
        whole(*arguments)
        table.write_text("mine")

    with monkeypatch.context() as patch:
        patch.setattr(runner, "run_here", run_here)
        done = stickslip(*sweep)
    assert done.returncode == 2
    assert "--out table.csv: cannot be written: File exists" in done.stderr
    assert table.read_text() == "mine"
    table.unlink()
    begun = (tmp_path / "table.csv.part").read_bytes()
    assert begun.count(b"\n") > 1
    assert stickslip(*sweep).returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]


def test_no_default_is_reported_for_a_varied_parameter(stickslip: Run, tmp_path: Path) -> None:
    text = "/**/plant:\n  ros__parameters: {mass: 2.0}\n"
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    over = ("--over", "plant.belt_speed=0.6:0.7:2", "--no-control")
    (line,) = stickslip("sweep", "mine.yaml", *over).stderr.splitlines()
    assert "plant.stiffness = 1.0 N/m" in line
    assert "belt_speed" not in line


def test_a_sweep_of_an_axis_measures_the_forced_cycles(stickslip: Run) -> None:
    over = "plant.disturbance.amplitude=10:60:2"
    points = stickslip.json("sweep", "axis", "--over", over)
    assert points["regime"] == ["stuck", "stick_slip"]
    assert points["amplitude"] == pytest.approx([0.0, 28.98e-6], rel=1e-3)
    still, moving = ([round(each, 12) for each in turns] for turns in points["turning_points"])
    assert (len(set(still)), len(set(moving))) == (1, 2)
    assert len(moving) < 40  # a rest is one turning point


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
        told = f"basins of feed_drive, 2 starts{advice}\n"
        assert done.stderr == (told if advice else "")


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
