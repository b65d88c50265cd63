"""`stickslip identify`: from a log to a model, a scenario and a figure."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError
from tests.app.conftest import Run
from tests.identification.axis_record import record
from tests.record.runs import full_disk

_COLUMNS = "time=t,position=x,force=u*2,reference=r"
_BY_NAME = dict(each.split("=") for each in _COLUMNS.split(","))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log of an axis without a spring."""
    own = record("saturating", duration=4.0)
    time = own.period * np.arange(len(own.position))
    rows = np.column_stack([time, own.position, own.force / 2.0, own.reference])
    return written(tmp_path / "axis.csv", rows)


def written(path: Path, rows: np.ndarray, heading: str = "t,x,u,r") -> Path:
    np.savetxt(path, rows, delimiter=",", header=heading, comments="")
    return path


def test_a_log_becomes_a_model_a_scenario_and_a_figure(
    stickslip: Run, tmp_path: Path, log: Path
) -> None:
    given = ("--columns", _COLUMNS, "--law", "table", "--check", "axis.csv")
    files = ("--out", "found.yaml", "--plot", "found.png")
    found = stickslip.json("identify", "axis.csv", *given, *files)
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
    assert stickslip("simulate", "found.yaml", "--duration", "1").returncode == 0


@pytest.mark.long
def test_recordings_that_are_checked(stickslip: Run, log: Path) -> None:
    """With gaps, in parts, and with a column that the log lacks."""
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    often, late = rows.copy(), rows.copy()
    often[::7, 3] = np.nan
    late[:300, 3] = np.nan
    written(log.parent / "often.csv", often)
    written(log.parent / "late.csv", late)
    written(log.parent / "parts.csv", np.delete(rows, range(2000, 2100), 0))
    taps = np.column_stack([rows, np.zeros(len(rows))])
    written(log.parent / "taps.csv", taps, "t,x,u,r,taps")
    given = ("--columns", f"{_COLUMNS},disturbance=taps", "--law", "coulomb")
    names = ["often.csv", "late.csv", "parts.csv", "taps.csv"]
    checks = [word for name in names for word in ("--check", name)]
    found = stickslip.json("identify", "axis.csv", *given, *checks)
    shown = [*names[:2], "parts.csv, part 1", "parts.csv, part 2", "taps.csv"]
    assert [each["recording"] for each in found["checks"]] == shown
    assert found["checks"][0]["position_error"] is None
    assert any("the reference of often.csv has no 500 samples" in note for note in found["notes"])
    assert found["checks"][1]["position_error"] == pytest.approx(found["position_error"], rel=0.1)
    assert found["checks"][-1]["force_error"] > 0.0
    assert not any("late.csv has no" in note for note in found["notes"])


@pytest.mark.long
def test_a_memory_in_both_directions_becomes_a_scenario(stickslip: Run, log: Path) -> None:
    given = ("--columns", _COLUMNS, "--law", "lugre", "--out", "found.yaml")
    found = stickslip.json("identify", "axis.csv", *given)
    assert found["position_error"] < 0.01
    assert found["free_run_error"] < 0.1
    friction = ss.scenario(log.parent / "found.yaml").plant.as_drive().friction
    assert friction.forward.bristle_stiffness == friction.reverse.bristle_stiffness
    assert friction.forward.curve != friction.reverse.curve


@pytest.mark.long
def test_a_model_in_python_is_saved_and_checked(tmp_path: Path, log: Path) -> None:
    """Of a recording in parts one must be chosen; on a full disk no file of a model is left."""
    model = ss.identify(log, columns=_BY_NAME, law="table")
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    parts = written(tmp_path / "parts.csv", np.delete(rows, range(2000, 2100), 0))
    with pytest.raises(InvalidInputError, match="has 2 parts between long gaps"):
        model.check(parts, _BY_NAME)
    assert model.check(parts, _BY_NAME, start=2.05)["force_error"] > 0.0
    before = {*tmp_path.iterdir()}
    # There is room for the curves, but not for the scenario.
    with full_disk(4096), pytest.raises(OSError, match="File too large"):
        model.save(tmp_path / "found.yaml")
    assert {*tmp_path.iterdir()} == before
    model.save(tmp_path / "found.yaml")


def test_a_map_gives_friction_alone(stickslip: Run, tmp_path: Path) -> None:
    speed = np.geomspace(0.001, 0.2, 20)
    force = (20.0 + 10.0 * np.exp(-speed / 0.01) + 60.0 * speed) / 2.0
    rows = np.column_stack([[*speed, *-speed], [*force, *-force]])
    table = written(tmp_path / "map.csv", rows, "v,f")
    arguments = ("identify", str(table), "--map", "--columns", "velocity=v,force=f*2")
    size = ("--style", "paper-double", "--size", "8x9", "--dpi", "100")
    done = stickslip(*arguments, "--plot", "map.png", *size)
    assert done.returncode == 0
    assert "law exponential" in done.stdout
    assert "40 pairs" in done.stdout
    with Image.open(tmp_path / "map.png") as image:
        assert image.size == (800, 900)
    assert "s/rad" in stickslip(*arguments, "--rotary").stdout
    in_amperes = ("--force-constant", "2N/A")
    again = stickslip.json(*arguments[:-1], "velocity=v,force=f", *in_amperes)
    assert again["parameters"] == stickslip.json(*arguments)["parameters"]
    model = ss.friction_map(table, columns={"velocity": "v", "force": "f*2"})
    assert stickslip.json(*arguments) == model.to_dict()
    refused = stickslip(*arguments[:-1], "velocity=0.01,force=f")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "velocity = 0.01 must be a column" in refused.stderr
