"""`stickslip simulate`: measures, the file of the samples, figures, and what is said."""

import csv
import json
from pathlib import Path

import pytest

import stickslip_ros as ss
from stickslip_ros.measures.following import Following
from stickslip_ros.quantities import quantities_of
from tests.app.conftest import Run


def rows_of(path: Path) -> list[dict[str, float]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return [
            {name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)
        ]


@pytest.mark.parametrize(
    "flags", [(), pytest.param(("--continuous-control",), marks=pytest.mark.long)]
)
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
    if not flags:
        assert stickslip(*call, "--out", "some.csv", "--every", "0.007").returncode == 0
        assert rows_of(tmp_path / "some.csv") == rows[::7]


def test_where_nothing_is_measured_it_says_why(stickslip: Run) -> None:
    for arguments, why in (
        ("-p plant.belt_speed=40 --yes --duration 1", "in 1 s: the slide has neither turned back"),
        ("-p plant.belt_speed=100 --yes --duration 0.1", "is 2046 times the critical speed of"),
        ("--duration 0.05", "in 0.05 s: the natural period is 62.83 ms"),
        ("-p plant.belt_speed=0.005 --duration 0.19", "run it for longer"),
    ):
        done = stickslip("simulate", "feed_drive", "--no-control", *arguments.split())
        lines = done.stdout.splitlines()
        assert "no whole cycle" in lines[1]
        assert why in lines[-1]


def test_defaults_are_reported_once(stickslip: Run, tmp_path: Path) -> None:
    text = "/**/plant:\n  ros__parameters: {mass: 80.0, stiffness: 1.2e+6}\n"
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    call = ("simulate", "mine.yaml", "--duration", "1", "--json")
    alone, based = stickslip(*call), stickslip(*call, "--base", "feed_drive")
    (line,) = alone.stderr.splitlines()
    assert (
        "mine.yaml: using defaults: plant.damping = 0.02 N s/m, plant.normal_force = 1.0 N" in line
    )
    assert "washout_controller.corner_frequency = 2.0 rad/s" in line
    assert "plant.mass" not in line
    (line,) = based.stderr.splitlines()
    assert "washout_controller.linear_gain" in line
    assert "for the drive there" in line
    assert json.loads(based.stdout)["scenario"]["plant"]["normal_force"] == 1000.0
    (line,) = stickslip(*call, "--no-control").stderr.splitlines()
    assert "washout_controller" not in line


def test_a_law_that_is_not_passive_is_told(stickslip: Run) -> None:
    lugre = {"law": "lugre", "bristle_stiffness": 1e5, "bristle_damping": 100.0}
    lugre |= {"curve": "exponential", "decay_speed": 0.02, "kinetic": 0.25}
    call = ("simulate", "feed_drive", "--duration", "0.1")
    call += tuple(f"-p=plant.friction.{name}={value}" for name, value in lugre.items())
    told = stickslip(*call)
    assert "friction law lugre is not passive, and may supply energy" in told.stderr
    assert "viscous = 0 s/m is 60 s/m below" in told.stderr
    assert stickslip(*call, "-p=plant.friction.viscous=61").stderr == ""


def test_a_run_with_a_reference_tells_what_a_report_of_its_file_tells(
    stickslip: Run, tmp_path: Path
) -> None:
    gains = {"position_gain": 7.6e6, "integral_gain": 5.8e8, "velocity_gain": 4.1e4}
    reference = {"kind": "sine", "amplitude": 0.005, "frequency": 1.0}
    values = gains | {f"reference.{name}": value for name, value in reference.items()}
    given = [f"-ppid_controller.{name}={value}" for name, value in values.items()]
    given += ["-pplant.disturbance.kind=none", "-ppid_controller.force_limit=351.5"]
    call = ("simulate", "axis", "--controller", "pid", *given, "--duration", "2.6", "--json")
    done = stickslip(*call, "--out", "run.csv", "--plot", "run.svg")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["reversals"] == 5
    # Exact sticking of each of the two reversals in a cycle.
    assert 2.0 * found["reversal_rest"] == pytest.approx(
        found["stick_fraction"] * found["period"], abs=2e-3
    )
    assert 1e-6 < found["reversal_height"] <= found["peak_following_error"] < 1e-4
    assert "after each reversal<" in (tmp_path / "run.svg").read_text(encoding="utf-8")
    report = json.loads(stickslip("report", "run.csv", "--json").stdout)
    for name in quantities_of(Following):
        assert report[name] == pytest.approx(found[name], rel=1e-6, abs=1e-12)
