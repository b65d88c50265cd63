"""`stickslip identify`: from a log to a model, a scenario and a figure."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification import scenario
from tests.app.conftest import Run
from tests.identification.axis_record import record

_COLUMNS = "time=t,position=x,force=u*2,reference=r"
_BY_NAME = dict(each.split("=") for each in _COLUMNS.split(","))


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
    (mass,) = re.findall(r"plant\.mass +(\S+) kg +(\S+) kg ", done.stdout)
    assert len(mass[0].partition(".")[2]) >= 2
    assert float(mass[1]) < 1.0
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
        (("axis.csv", "--columns", "time=t,position=x,force=u*0"), "force is always 0"),
        (("axis.csv", "--columns", "time=t,positon=x"), "did you mean position? must be one of"),
        (("empty.csv", "--columns", _COLUMNS), "empty.csv: the file is empty"),
        (("heading.csv", "--columns", _COLUMNS), "heading.csv: the file has no rows"),
        (("alike.csv", "--columns", _COLUMNS), "the names of the columns, all different"),
        (("text.csv", "--columns", _COLUMNS), "text.csv: position (column x) has 0 finite"),
        (("axis.csv", "--columns", "time=t*1e10,position=x,force=u"), "differ by more than 9e+09"),
        (("axis.csv", "--columns", _COLUMNS, "--fix", "plant.mas=3"), "did you mean plant.mass?"),
        (
            ("axis.csv", "--columns", _COLUMNS, "--fix", "plant.force_delay=-0.5"),
            "-1 to 20 periods",
        ),
        (("axis.csv", "--columns", "time=t,position=x*0,force=u"), "the position has 1 value"),
        (("axis.csv", "--columns", _COLUMNS, "--law", "stribek"), "did you mean stribeck"),
        (
            ("axis.csv", "--columns", _COLUMNS, "--fix", "mass=3"),
            "did you mean plant.mass? must be",
        ),
        (("axis.csv", "--columns", _COLUMNS, "--fix", "plant.mass"), "--fix plant.mass: must be"),
        (("axis.csv", "--columns", _COLUMNS, "--to", "0.1"), "needs at least 500"),
        (("axis.csv", "--columns", _COLUMNS, "--from", "99"), "from 99 s on: it lasts 5.999 s"),
        (("axis.csv", "--columns", _COLUMNS, "--out", "a.txt"), "must end in .yaml"),
    ],
)
def test_what_is_refused(stickslip: Run, log: Path, given: tuple[str, ...], message: str) -> None:
    (log.parent / "empty.csv").write_text("")
    (log.parent / "heading.csv").write_text("t,x,u,r\n")
    (log.parent / "alike.csv").write_text("t,x,x\n1,2,3\n")
    rows = "".join(f"{1e-3 * number},on,1,0\n" for number in range(600))
    (log.parent / "text.csv").write_text("t,x,u,r\n" + rows)
    done = stickslip("identify", *given)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Warning" not in done.stderr
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


def test_a_memory_in_both_directions_becomes_a_scenario(stickslip: Run, log: Path) -> None:
    given = ("--columns", _COLUMNS, "--law", "lugre", "--json", "--out", "found.yaml")
    done = stickslip("identify", "axis.csv", *given)
    assert done.returncode == 0, done.stderr
    assert "stays at rest until" in done.stderr
    found = json.loads(done.stdout)
    assert found["position_error"] < 0.01
    assert found["free_run_error"] < 0.1
    friction = ss.scenario(log.parent / "found.yaml").plant.as_drive().friction
    assert friction.forward.bristle_stiffness == friction.reverse.bristle_stiffness
    assert friction.forward.curve != friction.reverse.curve


def test_what_cannot_be_written_leaves_no_files(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, log: Path
) -> None:
    model = ss.identify(log, columns=_BY_NAME, law="table")

    def refused(*_: object) -> None:
        raise InvalidInputError("it is refused")

    monkeypatch.setattr(scenario, "commented_file", refused)
    with pytest.raises(InvalidInputError, match="it is refused"):
        model.save(tmp_path / "found.yaml")
    assert [each.name for each in tmp_path.iterdir()] == ["axis.csv"]


def test_a_reference_with_gaps(stickslip: Run, log: Path) -> None:
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    often, late = rows.copy(), rows.copy()
    often[::7, 3] = np.nan
    late[:300, 3] = np.nan
    for name, values in (("often.csv", often), ("late.csv", late)):
        np.savetxt(log.parent / name, values, delimiter=",", header="t,x,u,r", comments="")
    checks = ("--check", "often.csv", "--check", "late.csv")
    given = ("identify", "axis.csv", "--columns", _COLUMNS, "--law", "coulomb", *checks)
    done = stickslip(*given, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["checks"][0]["position_error"] is None
    assert "the reference of often.csv has no 500 samples in a row" in found["notes"][-1]
    assert found["checks"][1]["position_error"] == pytest.approx(found["position_error"], rel=0.1)
    done = stickslip(*given)
    assert "nan" not in done.stdout.replace("plant.", "")
    assert "late.csv has no" not in done.stdout


def test_the_parts_of_a_checked_recording_are_numbered(stickslip: Run, log: Path) -> None:
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    both = np.delete(rows, range(3000, 3100), 0)
    np.savetxt(log.parent / "parts.csv", both, delimiter=",", header="t,x,u,r", comments="")
    given = ("--columns", _COLUMNS, "--law", "coulomb", "--json")
    done = stickslip("identify", "axis.csv", "--check", "parts.csv", *given)
    assert done.returncode == 0, done.stderr
    names = [each["recording"] for each in json.loads(done.stdout)["checks"]]
    assert names == ["parts.csv, part 1", "parts.csv, part 2"]
    model = ss.identify(log, columns=_BY_NAME, law="coulomb")
    with pytest.raises(InvalidInputError, match="has 2 parts between long gaps"):
        model.check(log.parent / "parts.csv", _BY_NAME)
    assert model.check(log.parent / "parts.csv", _BY_NAME, start=3.05)["force_error"] > 0.0


def test_all_constants_are_given(stickslip: Run) -> None:
    bag = Path(__file__).parents[2] / "bags" / "reference"
    known = {"mass": 100, "damping": 200, "stiffness": 1e6, "normal_force": 1000}
    known |= {"bias_force": 0.0, "friction.static": 0.4, "friction.viscous": 0.1}
    given = [f"--fix=plant.{name}={value}" for name, value in known.items()]
    done = stickslip("identify", str(bag), "--law", "coulomb", "--json", *given)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["parameters"] == {}
    assert set(found["curves"][0]["standard_error"]) == {0.0}


def test_units_that_are_wrong_are_noted(stickslip: Run, log: Path) -> None:
    columns = "time=t,position=x*1e3,force=u*2,reference=r*1e3"
    done = stickslip("identify", "axis.csv", "--columns", columns, "--law", "coulomb")
    assert done.returncode == 0, done.stderr
    assert "check the units of time, position and belt velocity" in done.stdout


def test_laws_that_predict_worse_say_by_how_much(stickslip: Run, log: Path) -> None:
    done = stickslip("identify", "axis.csv", "--columns", _COLUMNS)
    assert done.returncode == 0, done.stderr
    assert re.search(r"coulomb .* predicts worse, by \d+\.\d standard errors", done.stdout)
    assert "table and table" not in done.stdout
    assert "exponential and table predict" not in done.stdout
