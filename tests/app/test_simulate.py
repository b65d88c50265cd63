"""`stickslip simulate`: the limit cycles of the paper's drive, from the command line."""

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import stickslip_ros as ss
from tests.app.conftest import Run

# belt speed: amplitude, speed amplitude, stick fraction, period, midpoint (damping 0.02).
REFERENCE = {
    0.2: (0.318603222, 0.259152231, 0.285506954, 7.06772953, 0.261039897),
    0.3: (0.394200937, 0.346695251, 0.204072402, 6.61204441, 0.275610715),
    0.4: (0.434086183, 0.414381028, 0.100062954, 6.39242362, 0.326321421),
    0.46: (0.337968726, 0.335036166, 0.0, 6.36478480, 0.313080028),
}


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("belt_speed", REFERENCE)
def test_reference_limit_cycles(stickslip: Run, belt_speed: float, direction: float) -> None:
    speed = f"plant.belt_speed={direction * belt_speed}"
    # Slipping all the time, it tends to the cycle slowly. Without control a sample changes nothing.
    duration = ("--duration", "3000" if belt_speed == 0.46 else "300", "-p", "plant.rate=10")
    done = stickslip("simulate", "paper", "--no-control", "-p", speed, "--json", *duration)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    amplitude, speed_amplitude, stick_fraction, period, midpoint = REFERENCE[belt_speed]
    assert found["amplitude"] == pytest.approx(amplitude, abs=1e-7)
    assert found["velocity_amplitude"] == pytest.approx(speed_amplitude, abs=1e-7)
    assert found["period"] == pytest.approx(period, abs=1e-7)
    assert found["stick_fraction"] == pytest.approx(stick_fraction, abs=1e-6)
    assert found["midpoint"] == pytest.approx(direction * midpoint, abs=1e-7)
    assert found["regime"] == ("stick_slip" if stick_fraction else "pure_slip")


def test_continuous_and_sampled_control_quench_the_feed_drive(stickslip: Run) -> None:
    for flags in ((), ("--continuous-control",)):
        done = stickslip("simulate", "feed_drive", "--json", *flags)
        assert json.loads(done.stdout)["regime"] == "equilibrium"


@pytest.mark.parametrize("control", ["--no-control", "--continuous-control"])
def test_a_picture_is_of_the_motion_that_is_measured(
    stickslip: Run, tmp_path: Path, control: str
) -> None:
    call = ("simulate", "paper", control, "--duration", "100", "--json")
    plain = json.loads(stickslip(*call).stdout)
    done = stickslip(*call, "--plot", "run.svg")
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert found["regime"] == plain["regime"]
    assert found["amplitude"] == pytest.approx(plain["amplitude"], rel=1e-6, abs=1e-9)
    if control == "--no-control":
        assert found == plain
    picture = (tmp_path / "run.svg").read_text(encoding="utf-8")
    for text in ("phase portrait", "control force<", "each cycle"):
        assert text in picture


def test_a_picture_of_a_disturbed_run_says_so(stickslip: Run, tmp_path: Path) -> None:
    disturbed = ("-p", "plant.disturbance.kind=step", "-p", "plant.disturbance.amplitude=0.1")
    late = ("-p", "plant.force_delay=0.015", "--duration", "100")
    done = stickslip("simulate", "paper", *disturbed, *late, "--plot", "run.svg")
    assert done.returncode == 0, done.stderr
    picture = (tmp_path / "run.svg").read_text(encoding="utf-8")
    assert "control force and disturbance<" in picture
    assert "control switched on" not in picture


def test_a_picture_that_cannot_be_is_refused_before_anything_runs(stickslip: Run) -> None:
    done = stickslip("simulate", "paper", "--duration", "1e9", "--plot", "run.jpg")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--plot run.jpg: must end in one of .png, .svg, .pdf" in done.stderr


def test_json_is_all_there_is_on_standard_output_at_rest_too(stickslip: Run) -> None:
    speed = ("-p", "plant.belt_speed=0.7")
    done = stickslip("simulate", "paper", "--no-control", *speed, "--duration", "300", "--json")
    assert json.loads(done.stdout)["regime"] == "equilibrium"


def test_a_motion_that_runs_away_is_a_result(stickslip: Run) -> None:
    law = ("-p", "plant.friction.law=linear", "-p", "plant.friction.slope=0.9")
    done = stickslip(
        "simulate", "paper", "--no-control", "-p", "plant.belt_speed=0.2", *law, "--json"
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["regime"] == "unbounded"
    assert found["period"] is None


@pytest.mark.parametrize(
    ("arguments", "regime", "steady", "trend"),
    [
        (("feed_drive", "--no-control"), "stick_slip", True, None),
        (("feed_drive", "--duration", "5.3"), "stick_slip", False, "decaying"),
        (("feed_drive", "-p", "plant.rate=200"), "equilibrium", True, None),
        (("paper", "-p", "plant.belt_speed=0", "--no-control"), "stuck", True, None),
        (("paper", "--no-control", "--duration", "15"), "stick_slip", None, None),
        (("paper", "--no-control", "--duration", "3"), None, None, None),
    ],
)
def test_it_says_whether_the_motion_was_steady(
    stickslip: Run,
    arguments: tuple[str, ...],
    regime: str | None,
    steady: bool | None,
    trend: str | None,
) -> None:
    found = json.loads(stickslip("simulate", *arguments, "--json").stdout)
    assert (found["regime"], found["steady"], found["trend"]) == (regime, steady, trend)


def rows_of(path: Path) -> list[dict[str, float]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return [
            {name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)
        ]


@pytest.mark.parametrize("flags", [(), ("--continuous-control",)])
def test_the_file_has_the_trajectory_to_the_last_digit(
    stickslip: Run, tmp_path: Path, flags: tuple[str, ...]
) -> None:
    call = ("simulate", "feed_profile", "--duration", "1.9", *flags, "--json")
    done = stickslip(*call, "--out", "run.csv")
    assert (done.returncode, done.stderr) == (0, "")
    if not flags:  # continuous control acts in shorter steps
        assert done.stdout == stickslip(*call).stdout
    run = ss.simulate("feed_profile", duration=1.9, continuous=bool(flags))
    columns = vars(run.trajectory)
    rows = rows_of(tmp_path / "run.csv")
    assert list(rows[0]) == [
        "time", "position", "velocity", "friction_force", "control_force", "belt_position",
        "belt_velocity",
    ]  # fmt: skip
    assert {name: [row[name] for row in rows] for name in rows[0]} == {
        name: values.tolist() for name, values in columns.items()
    }
    assert rows[-1]["time"] == 1.9
    assert rows[-1]["belt_velocity"] > 0.0
    assert list(tmp_path.iterdir()) == [tmp_path / "run.csv"]


def test_every_interval_of_the_file_is_a_row(stickslip: Run, tmp_path: Path) -> None:
    call = ("simulate", "feed_drive", "--duration", "0.5", "--out")
    assert stickslip(*call, "all.csv").returncode == 0
    assert stickslip(*call, "some.csv", "--every", "0.007").returncode == 0
    rows = rows_of(tmp_path / "some.csv")
    assert rows == rows_of(tmp_path / "all.csv")[::7]
    assert [row["time"] for row in rows[:3]] == [0.0, 0.007, 0.014]


@pytest.mark.parametrize(
    ("options", "refusal"),
    [
        (("--out", "run.txt"), "--out run.txt: must end in .csv"),
        (("--out", "there.csv"), "--out there.csv: exists already; it is not overwritten"),
        (("--out", "nowhere/run.csv"), "--out nowhere/run.csv: there is no directory nowhere"),
        (("--every", "0.1"), "--every 0.1: needs --out FILE.csv, which is not given"),
        (
            ("--out", "run.csv", "--every", "0.0015"),
            "--every 0.0015: must be a multiple of the sample period, 0.001 s",
        ),
        (
            ("--out", "run.csv", "--every", "0"),
            "--every 0: must be a multiple of the sample period, 0.001 s",
        ),
        (("--out", "run.csv", "--every", "inf"), "'inf' is not a time in seconds"),
    ],
)
def test_a_file_that_cannot_be_is_refused_before_anything_runs(
    stickslip: Run, tmp_path: Path, options: tuple[str, ...], refusal: str
) -> None:
    (tmp_path / "there.csv").touch()
    done = stickslip("simulate", "feed_drive", "--duration", "1e9", *options)
    assert (done.returncode, done.stdout) == (2, "")
    assert refusal in done.stderr
    assert list(tmp_path.iterdir()) == [tmp_path / "there.csv"]


def test_a_run_that_fails_leaves_no_file(stickslip: Run, tmp_path: Path) -> None:
    stiff = ("-p", "plant.damping=1e9", "--continuous-control")
    done = stickslip("simulate", "paper", *stiff, "--out", "run.csv")
    assert done.returncode == 1
    assert "too stiff" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.process
def test_without_a_standard_output_there_is_no_traceback(tmp_path: Path) -> None:
    done = subprocess.run(
        f"{sys.executable} -m stickslip_ros.app.main simulate paper --duration 1 >&-",
        shell=True,
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (
            ("-p", "plant.belt_speed=40", "--duration", "1"),
            (
                "in 1 s: the slide has neither turned back",
                "40 m/s is 818.4 times the Hopf speed of",
            ),
        ),
        (("--duration", "0.05"), ("in 0.05 s: the natural period is 62.83 ms",)),
        (("-p", "plant.belt_speed=0.005", "--duration", "0.19"), ("0.19 s: ", "run it for longer")),
    ],
)
def test_where_nothing_is_measured_it_says_why(
    stickslip: Run, arguments: tuple[str, ...], why: tuple[str, ...]
) -> None:
    done = stickslip("simulate", "feed_drive", "--no-control", *arguments)
    lines = done.stdout.splitlines()
    assert "no whole cycle" in lines[1]
    for text in why:
        assert text in lines[-1]


def test_the_dimensionless_drive_has_no_units(stickslip: Run) -> None:
    lines = stickslip("simulate", "paper", "--no-control", "--duration", "100").stdout.splitlines()
    assert lines[0] == "paper, 100"
    assert [line.split()[-1] for line in lines[1:4]] == ["stick-slip", "0.4341", "0.4144"]
    assert all(len(re.split("  +", line)[1].split()) == 1 for line in lines[1:])


def test_defaults_are_reported_once(stickslip: Run, tmp_path: Path) -> None:
    text = "/**/plant:\n  ros__parameters: {mass: 80.0, stiffness: 1.2e+6}\n"
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    call = ("simulate", "mine.yaml", "--duration", "1", "--json")
    alone, based = stickslip(*call), stickslip(*call, "--base", "feed_drive")
    (line,) = alone.stderr.splitlines()
    assert "mine.yaml does not give plant.damping = 0.02 N s/m, plant.normal_force = 1.0 N" in line
    assert "washout_controller.corner_frequency = 2.0 rad/s" in line
    assert "plant.mass" not in line
    assert based.stderr == ""
    assert json.loads(based.stdout)["scenario"]["plant"]["normal_force"] == 1000.0
    (line,) = stickslip(*call, "--no-control").stderr.splitlines()
    assert "washout_controller" not in line
