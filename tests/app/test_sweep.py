"""`stickslip sweep`: tables, figures, refusals, and interrupted sweeps."""

import csv
import json
import signal
import time
from collections.abc import Callable
from pathlib import Path
from subprocess import Popen

import pytest

from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.columns import compute_columns
from stickslip_ros.studies.plan import Axis
from stickslip_ros.studies.settling import SettlingCourse
from stickslip_ros.studies.sweep import sweep_study
from tests.app.conftest import Run
from tests.nodes.graph import PATIENCE

FREE = ("sweep", "paper", "--no-control", "--transient", "100")
SPEEDS = ("--over", "plant.belt_speed=0.2:0.6:5")
PNG = b"\x89PNG"


def test_the_table_has_what_the_python_interface_returns(stickslip: Run, tmp_path: Path) -> None:
    done = stickslip(*FREE, *SPEEDS, "--out", "table.csv", "--plot", "diagram.png")
    assert done.returncode == 0, done.stderr
    scenario = load_scenario("paper", ["plant.expects_control=false"])
    study = sweep_study(
        scenario, [Axis("plant.belt_speed", 0.2, 0.6, 5)], course=SettlingCourse(100.0)
    )
    found = compute_columns(study)
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["plant.belt_speed"]) for row in rows] == [0.2, 0.3, 0.4, 0.5, 0.6]
    assert [row["regime"] for row in rows] == found.regime.tolist()
    assert [float(row["amplitude"]) for row in rows] == found.amplitude.tolist()
    sections = [tuple(map(float, row["turning_points"].split())) for row in rows]
    assert sections == list(found.turning_points)
    assert (tmp_path / "diagram.png").read_bytes().startswith(PNG)
    assert not (tmp_path / "table.csv.part").exists()
    for text in ("stick-slip", "0.2 to 0.4", "equilibrium"):
        assert text in done.stdout


def test_json_on_standard_output_and_in_a_file_are_the_same(stickslip: Run, tmp_path: Path) -> None:
    over = ("--over", "plant.damping=0.01:0.02:2", "--over", "plant.belt_speed=0.2:0.4:3")
    done = stickslip(*FREE, *over, "--json", "--out", "table.json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found == json.loads((tmp_path / "table.json").read_text())
    assert found["parameters"] == ["plant.damping", "plant.belt_speed"]
    assert found["values"] == [[0.01, 0.02], pytest.approx([0.2, 0.3, 0.4])]
    assert found["scenario"]["name"] == "paper"
    assert found["overrides"] == ["plant.expects_control=false"]
    assert found["course"]["transient"] == 100.0
    assert found["amplitude"][3:] == pytest.approx([0.318603222, 0.394200937, 0.434086183])
    assert found["stick_fraction"][3] == pytest.approx(0.285506954)
    assert len(found["regime"]) == len(found["turning_points"]) == 6


def test_the_ends_of_every_sticking_range_are_reported(stickslip: Run, tmp_path: Path) -> None:
    stiff = ("-p", "plant.stiffness=1000", "--over", "plant.belt_speed=0.1:0.6:3")
    done = stickslip(*FREE, *stiff, "--out", "table.json")
    assert "limit of sticking: 188.9 mm/s, 392.4 mm/s, 437.2 mm/s" in done.stdout
    assert "Hopf point: 488.8 mm/s" in done.stdout
    transitions = json.loads((tmp_path / "table.json").read_text())["transitions"]
    assert transitions["limit_of_sticking"] == pytest.approx([0.18888, 0.39236, 0.43716], abs=1e-5)
    assert transitions["hopf_point"] == pytest.approx([0.48876], abs=1e-5)


def test_rounding_is_shown_as_zero(stickslip: Run) -> None:
    over = ("--over", "plant.belt_speed=0.002:0.06:3", "--transient", "400")
    done = stickslip("sweep", "feed_drive", *over)
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("equilibrium"))
    assert line.split()[-3:] == ["0", "m", "0"]


def test_carried_both_ways_the_table_has_a_direction(stickslip: Run, tmp_path: Path) -> None:
    done = stickslip(*FREE, *SPEEDS, "--carry", "both", "--out", "table.csv")
    assert done.returncode == 0, done.stderr
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["direction"] for row in rows] == ["up"] * 5 + ["down"] * 5
    assert [row["plant.belt_speed"] for row in rows[:5]] == [
        row["plant.belt_speed"] for row in rows[5:]
    ]


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_is_drawn_in_each_colour(stickslip: Run, tmp_path: Path) -> None:
    over = ("--over", "plant.damping=0.01:0.1:4", "--over", "plant.belt_speed=0.2:0.6:5")
    for colour in ("regime", "amplitude", "stick_fraction"):
        done = stickslip(*FREE, *over, "--plot", f"{colour}.svg", "--colour", colour)
        assert done.returncode == 0, done.stderr
        assert "<svg" in (tmp_path / f"{colour}.svg").read_text()
    assert "stick-slip" in done.stdout


def test_control_is_sampled_unless_it_is_to_be_continuous(stickslip: Run) -> None:
    # Three samples per second are too few for gains that calm the continuous loop.
    over = ("--over", "washout_controller.linear_gain=-8:-7:2", "--transient", "40")
    calm = ("-p", "washout_controller.cubic_gain=0", "-p", "plant.rate=3")
    sampled = json.loads(stickslip("sweep", "paper", *calm, *over, "--json").stdout)
    options = ("--continuous-control", "--json")
    continuous = json.loads(stickslip("sweep", "paper", *calm, *over, *options).stdout)
    assert continuous["regime"] == ["equilibrium", "equilibrium"]
    assert "equilibrium" not in sampled["regime"]


def test_a_point_that_cannot_be_is_a_row_with_its_reason(stickslip: Run) -> None:
    done = stickslip(*FREE, "--over", "plant.friction.minimum=0.3:0.5:3", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["reason"][:2] == [None, None]
    assert "friction.minimum = 0.5 must not exceed friction.static = 0.4" in found["reason"][2]
    assert found["regime"][2] is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--over", "belt_speed=1:2:3"], "belt_speed: must be a parameter of plant or washout"),
        (
            ["--over", "plant.speed=1:2:3"],
            "plant.speed: unknown parameter; did you mean plant.belt_speed or",
        ),
        (["--over", "plant.pace=1:2:3"], "plant.pace: is not a number"),
        (["--over", "plant.mass=1:2"], "must be NODE.PARAMETER=A:B:COUNT"),
        (["--over", "plant.mass=1:1:3"], "must be two different finite numbers"),
        (["--over", "plant.mass=1:2:1"], "1 values: must be from 2 to"),
        (["--over", "plant.damping=-1:1:3"], "damping = -1.0 is refused: must be a finite number"),
        (["--over", "plant.belt_speed=-1:1:3:log"], "must have one sign and exclude zero"),
        (["--over", "washout_controller.linear_gain=-1:0:3"], "there is no controller"),
        (["--over", "plant.friction.static=0.1:0.2:3"], "friction.minimum = 0.25 must not exceed"),
        ([*SPEEDS, *SPEEDS], "must be different parameters"),
        ([*SPEEDS, "--colour", "amplitude"], "is for maps, of two parameters"),
        ([*SPEEDS, "--out", "table.txt"], "--out table.txt: must end in one of .csv, .json"),
        ([*SPEEDS, "--out", "missing/table.csv"], "there is no directory missing"),
        ([*SPEEDS, "--plot", "diagram.jpg"], "--plot diagram.jpg: must end in one of"),
        ([*SPEEDS, "--transient", "-1"], "a transient of -1 natural periods: must be from 0"),
        ([*SPEEDS, "--cycles", "0"], "0 cycles to measure: must be from 1"),
        ([*SPEEDS, "--workers", "0"], "'0' is not a number of processes"),
        ([*SPEEDS, "--dask", "nowhere"], "--dask nowhere: no scheduler found"),
    ],
)
def test_invalid_input_is_refused(stickslip: Run, arguments: list[str], message: str) -> None:
    done = stickslip(*FREE, *arguments)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


def test_an_existing_table_is_left_alone(stickslip: Run, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("mine")
    done = stickslip(*FREE, *SPEEDS, "--out", "table.csv")
    assert done.returncode == 2
    assert "--out table.csv: exists already; it is not overwritten" in done.stderr
    assert (tmp_path / "table.csv").read_text() == "mine"


@pytest.mark.parametrize("workers", ["1", "2"])
def test_interrupted_it_keeps_what_is_done_and_goes_on_from_there(
    start_stickslip: Callable[..., Popen[str]], stickslip: Run, tmp_path: Path, workers: str
) -> None:
    speeds = ("--over", "plant.belt_speed=0.1:0.5:1200")
    process = start_stickslip(*FREE, *speeds, "--workers", workers, "--out", "table.csv")
    part = tmp_path / "table.csv.part"
    deadline = time.monotonic() + PATIENCE
    while not part.exists() or part.read_bytes().count(b"\n") < 2:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, messages = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "of 1200 points are done; they stay in table.csv.part" in messages
    assert "Traceback" not in messages
    assert not (tmp_path / "table.csv").exists()
    kept = part.read_bytes()
    done = stickslip(*FREE, *SPEEDS, "--out", "table.csv")
    assert done.returncode == 2
    assert "belongs to another study, which differs in plan.axes" in done.stderr
    assert part.read_bytes() == kept
    done = stickslip(*FREE, *speeds, "--out", "table.csv")
    assert done.returncode == 0, done.stderr
    done = stickslip(*FREE, *speeds, "--out", "whole.csv", "--workers", "2")
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
