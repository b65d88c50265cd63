"""`stickslip sweep`: tables, figures, and interrupted sweeps."""

import csv
import json
import signal
from pathlib import Path
from typing import Any

import pytest

from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies import runner
from stickslip_ros.studies.plan import Axis
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.studies.study import sweep_study
from tests.app.conftest import Run, Start, ended
from tests.nodes.graph import wait_for

FREE = ("sweep", "paper", "--no-control", "--transient", "100")
SPEEDS = ("--over", "plant.belt_speed=0.2:0.6:5")
PNG = b"\x89PNG"


def rows_of(table: Path) -> list[dict[str, str]]:
    with table.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_table_has_what_the_python_interface_returns(stickslip: Run, tmp_path: Path) -> None:
    done = stickslip(*FREE, *SPEEDS, "--out", "table.csv", "--plot", "diagram.png")
    assert done.returncode == 0, done.stderr
    scenario = load_scenario("paper", ["plant.expects_control=false"])
    study = sweep_study(
        scenario, [Axis("plant.belt_speed", 0.2, 0.6, 5)], settling=SettlingOptions(100.0)
    )
    found = compute_columns(study)
    rows = rows_of(tmp_path / "table.csv")
    assert [float(row["plant.belt_speed"]) for row in rows] == [0.2, 0.3, 0.4, 0.5, 0.6]
    assert [row["regime"] for row in rows] == found.regime.tolist()
    assert [float(row["amplitude"]) for row in rows] == found.amplitude.tolist()
    sections = [tuple(map(float, row["turning_points"].split())) for row in rows]
    assert sections == list(found.turning_points)
    assert (tmp_path / "diagram.png").read_bytes().startswith(PNG)
    assert not (tmp_path / "table.csv.part").exists()
    for text in ("stick-slip", "0.2 to 0.4", "equilibrium"):
        assert text in done.stdout


@pytest.mark.parametrize(
    ("values", "options", "expected"),
    [
        ("1:4:4", ("--carry", "both"), {"1", "2", "3", "4"}),
        ("1:8:4:log", ("--over", "plant.belt_speed=0.2:0.3:2"), {"1", "2", "4", "8"}),
    ],
)
def test_whole_numbers_are_swept_to_the_end(
    stickslip: Run, tmp_path: Path, values: str, options: tuple[str, ...], expected: set[str]
) -> None:
    parameter, law = "plant.friction.elements", ("-p", "plant.friction.law=maxwell_slip")
    short = ("--transient", "2", "--cycles", "1", *law, "--over", f"{parameter}={values}")
    sweep = ("sweep", "paper", "--no-control", *short, *options)
    found = stickslip.json(*sweep, "--out", "t.csv", "--plot", "t.png")
    assert {row[parameter] for row in rows_of(tmp_path / "t.csv")} == expected
    assert sorted(path.name for path in tmp_path.iterdir()) == ["t.csv", "t.png"]
    assert all(isinstance(value, int) for value in found["values"][0])
    assert found["transitions"] == {}


def test_json_on_standard_output_and_in_a_file_are_the_same(stickslip: Run, tmp_path: Path) -> None:
    over = ("--over", "plant.damping=0.01:0.02:2", "--over", "plant.belt_speed=0.2:0.4:3")
    found = stickslip.json(*FREE, *over, "--out", "table.json")
    assert found == json.loads((tmp_path / "table.json").read_text())
    assert found["parameters"] == ["plant.damping", "plant.belt_speed"]
    assert found["values"] == [[0.01, 0.02], pytest.approx([0.2, 0.3, 0.4])]
    assert found["scenario"]["name"] == "paper"
    assert found["overrides"] == ["plant.expects_control=false"]
    assert found["course"]["transient"] == 100.0
    assert found["amplitude"][3:] == pytest.approx([0.318603222, 0.394200937, 0.434086183])
    assert found["stick_fraction"][3] == pytest.approx(0.285506954)
    assert len(found["regime"]) == len(found["turning_points"]) == 6


def test_rounding_is_shown_as_zero(stickslip: Run) -> None:
    over = ("--over", "plant.belt_speed=0.002:0.06:3", "--transient", "400")
    done = stickslip("sweep", "feed_drive", *over)
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("equilibrium"))
    assert line.split()[-3:] == ["0", "m", "0"]


def test_carried_both_ways_the_table_has_a_direction(stickslip: Run, tmp_path: Path) -> None:
    done = stickslip(*FREE, *SPEEDS, "--carry", "both", "--out", "table.csv")
    assert done.returncode == 0, done.stderr
    rows = rows_of(tmp_path / "table.csv")
    assert [row["direction"] for row in rows] == ["up"] * 5 + ["down"] * 5
    speeds = [row["plant.belt_speed"] for row in rows]
    assert speeds[:5] == speeds[5:]


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_is_drawn(stickslip: Run, tmp_path: Path) -> None:
    over = ("--over", "plant.damping=0.01:0.1:2", "--over", "plant.belt_speed=0.2:0.6:3")
    done = stickslip(*FREE, *over, "--plot", "map.svg", "--colour", "stick_fraction")
    assert done.returncode == 0, done.stderr
    assert "stick fraction" in (tmp_path / "map.svg").read_text()
    assert "stick-slip" in done.stdout


def test_a_table_that_came_meanwhile_is_left_alone_and_the_points_are_kept(
    stickslip: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table, whole = tmp_path / "table.csv", runner.run_here

    def run_here(*arguments: Any) -> None:
        whole(*arguments)
        table.write_text("mine")

    with monkeypatch.context() as patch:
        patch.setattr(runner, "run_here", run_here)
        done = stickslip(*FREE, *SPEEDS, "--out", "table.csv")
    assert done.returncode == 2
    assert "--out table.csv: cannot be written: File exists" in done.stderr
    assert table.read_text() == "mine"
    table.unlink()
    begun = (tmp_path / "table.csv.part").read_bytes()
    assert begun.count(b"\n") > 1
    assert stickslip(*FREE, *SPEEDS, "--out", "table.csv").returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]


@pytest.mark.parametrize(
    ("workers", "count"), [("1", 200), pytest.param("2", 800, marks=pytest.mark.long)]
)
def test_interrupted_it_keeps_what_is_done_and_goes_on_from_there(
    start_stickslip: Start, stickslip: Run, tmp_path: Path, workers: str, count: int
) -> None:
    speeds = ("--over", f"plant.belt_speed=0.1:0.5:{count}")
    process = start_stickslip(*FREE, *speeds, "--workers", workers, "--out", "table.csv")
    part = tmp_path / "table.csv.part"
    wait_for(
        lambda: process.poll() or (part.exists() and part.read_bytes().count(b"\n") > 1), "points"
    )
    _, messages = ended(process, 130, signal.SIGINT)
    assert f"of {count} points are done; they stay in table.csv.part" in messages
    assert "Traceback" not in messages
    assert not (tmp_path / "table.csv").exists()
    kept = part.read_bytes()
    done = stickslip(*FREE, *SPEEDS, "--out", "table.csv")
    assert done.returncode == 2
    assert "belongs to another study, which differs in plan.axes" in done.stderr
    assert part.read_bytes() == kept
    for name in ("table.csv", "whole.csv"):
        done = stickslip(*FREE, *speeds, "--out", name)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "table.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    assert not part.exists()


def test_no_default_is_reported_for_a_varied_parameter(stickslip: Run, tmp_path: Path) -> None:
    text = "/**/plant:\n  ros__parameters: {mass: 2.0}\n"
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    over = ("--over", "plant.belt_speed=0.6:0.7:2", "--no-control")
    (line,) = stickslip("sweep", "mine.yaml", *over).stderr.splitlines()
    assert "plant.stiffness = 1.0 N/m" in line
    assert "belt_speed" not in line
