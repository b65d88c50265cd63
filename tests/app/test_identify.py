"""`stickslip identify`: from a log to a model, a scenario and a figure."""

import json
from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from tests.app.conftest import Run
from tests.identification.axis_record import record

_COLUMNS = "time=t,position=x,force=u*2,reference=r"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log of an axis without a spring."""
    own = record("saturating", duration=6.0)
    assert own.force is not None
    assert own.reference is not None
    time = own.period * np.arange(len(own.position))
    rows = np.column_stack([time, own.position, own.force / 2.0, own.reference])
    path = tmp_path / "axis.csv"
    np.savetxt(path, rows, delimiter=",", header="t,x,u,r", comments="")
    return path


def test_a_log_becomes_a_model_a_scenario_and_a_figure(
    stickslip: Run, tmp_path: Path, log: Path
) -> None:
    given = ("--columns", _COLUMNS, "--law", "table", "--check", "axis.csv")
    done = stickslip(
        "identify", "axis.csv", *given, "--json", "--out", "found.yaml", "--plot", "found.png"
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["law"] == "table"
    mass = found["parameters"]["plant.mass"]
    low, high = mass["interval"]
    assert low < mass["value"] < high
    assert mass["value"] == pytest.approx(95.0, rel=0.05)
    assert found["unidentified"].keys() >= {"plant.damping", "plant.bias_force"}
    assert [each["law"] for each in found["candidates"]] == ["table"]
    assert found["checks"][0]["recording"] == "axis.csv"
    assert found["checks"][0]["force_error"] == pytest.approx(found["force_error"])
    assert found["servo"]["difference_samples"] == 2
    assert (tmp_path / "found.png").stat().st_size > 10_000
    scenario = ss.scenario(tmp_path / "found.yaml")
    assert scenario.plant.mass == mass["value"]
    assert scenario.plant.friction.law == "table"
    assert (tmp_path / "found-forward.csv").exists()
    done = stickslip("simulate", "found.yaml", "--duration", "1")
    assert done.returncode == 0, done.stderr
    done = stickslip("identify", "axis.csv", *given, "--out", "found.yaml")
    assert done.returncode == 2
    assert "exists already" in done.stderr


def test_the_tables_say_what_was_found(stickslip: Run, log: Path) -> None:
    done = stickslip("identify", "axis.csv", "--columns", _COLUMNS, "--law", "coulomb")
    assert done.returncode == 0, done.stderr
    for words in (
        "law coulomb",
        "plant.mass",
        "95 % interval",
        "chosen",
        "is not told",
        "free run",
    ):
        assert words in done.stdout


def test_a_bag_of_a_loop_is_identified(stickslip: Run) -> None:
    bag = Path(__file__).parents[2] / "bags" / "reference"
    known = ("--fix", "plant.mass=100", "--fix", "plant.damping=200")
    known += ("--fix", "plant.normal_force=1000")
    done = stickslip("identify", str(bag), "--law", "stribeck", *known, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["parameters"]
    assert found["plant.stiffness"]["value"] == pytest.approx(1e6, rel=1e-3)
    assert found["plant.friction.static"]["value"] == pytest.approx(0.4, rel=1e-2)
    assert found["plant.friction.minimum"]["value"] == pytest.approx(0.25, rel=1e-2)


@pytest.mark.process
def test_a_bag_of_a_controlled_loop_with_a_lagging_actuator(stickslip: Run) -> None:
    given = {
        "plant.actuator.time_constant": "0.003",
        "plant.sensor.position_resolution": "1e-6",
        "plant.sensor.velocity": "difference",
        "plant.disturbance.kind": "sine",
        "plant.disturbance.amplitude": "100",
        "plant.disturbance.frequency": "7",
        "plant.disturbance.duration": "9",
        "washout_controller.start_after": "0.5",
    }
    options = [f"-p={name}={value}" for name, value in given.items()]
    loop = ("run", "feed_drive", "--composed", "--pace", "lockstep", "--duration", "2")
    assert stickslip(*loop, "--bag", "loop", *options).returncode == 0
    known = ("--fix", "plant.normal_force=1000", "--fix", "plant.damping=200")
    done = stickslip("identify", "loop", "--law", "stribeck", *known, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    for name, value in {
        "plant.mass": 100.0,
        "plant.stiffness": 1e6,
        "plant.friction.static": 0.4,
        "plant.friction.minimum": 0.25,
        "plant.friction.minimum_speed": 0.05,
    }.items():
        each = found["parameters"][name]
        assert each["value"] == pytest.approx(value, rel=2e-3), name
    assert found["segment_error"] < 5e-7


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("axis.csv",), "say what they are"),
        (("none.csv",), "the file cannot be read"),
        (("axis.csv", "--columns", "time=t,position=x"), "name its column"),
        (("axis.csv", "--columns", _COLUMNS, "--law", "stribek"), "did you mean stribeck"),
        (("axis.csv", "--columns", _COLUMNS, "--fix", "mass=3"), "must be plant.PARAMETER"),
        (("axis.csv", "--columns", _COLUMNS, "--fix", "plant.mass"), "--fix plant.mass: must be"),
        (("axis.csv", "--columns", _COLUMNS, "--to", "0.1"), "needs at least 500"),
        (("axis.csv", "--columns", _COLUMNS, "--from", "99"), "holds no samples"),
        (("axis.csv", "--columns", _COLUMNS, "--out", "a.txt"), "must end in .yaml"),
    ],
)
def test_what_is_refused(stickslip: Run, log: Path, given: tuple[str, ...], message: str) -> None:
    done = stickslip("identify", *given)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_a_column_that_only_a_checked_table_has(stickslip: Run, tmp_path: Path, log: Path) -> None:
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    with_taps = np.column_stack([rows, np.zeros(len(rows))])
    heading = "t,x,u,r,taps"
    np.savetxt(tmp_path / "taps.csv", with_taps, delimiter=",", header=heading, comments="")
    given = ("--columns", f"{_COLUMNS},disturbance=taps", "--law", "coulomb", "--json")
    done = stickslip("identify", "axis.csv", "--check", "taps.csv", *given)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["checks"][0]["force_error"] > 0.0
    done = stickslip("identify", "axis.csv", *given)
    assert done.returncode == 2
    assert "has no column 'taps'" in done.stderr
