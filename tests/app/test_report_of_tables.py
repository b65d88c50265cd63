"""`stickslip report` of tables: our own CSV files, and those of others."""

from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from tests.app.conftest import Run, Start, ended


@pytest.fixture
def log(stickslip: Run, tmp_path: Path) -> Path:
    """A simulated run as a table."""
    given = ("feed_drive", "--no-control", "--duration", "2", "--out", "log.csv")
    done = stickslip("simulate", *given)
    assert done.returncode == 0, done.stderr
    return tmp_path / "log.csv"


def test_our_own_table_is_measured_as_the_samples_of_a_run(stickslip: Run, log: Path) -> None:
    report = stickslip.json("report", "log.csv")
    run = ss.simulate(ss.scenario("feed_drive", expects_control=False), duration=2.0)
    assert report["regime"] == "stick_slip"
    assert report["amplitude"] == pytest.approx(run.measures.amplitude, rel=1e-4)
    assert report["period"] == pytest.approx(run.measures.period, rel=1e-5)
    assert (report["bag"], report["samples"], report["notes"]) == ("log.csv", 2001, [])
    table = "time=time,position=position,velocity=velocity"
    other = stickslip.json("report", "log.csv", "--columns", table, "--belt-speed", "0.04")
    for name in ("regime", "amplitude", "stick_fraction"):
        assert other[name] == report[name]
    assert not any("belt" in note for note in other["notes"])
    assert ss.read_table(log, belt_speed=0.04).measures.stick_fraction == report["stick_fraction"]
    faster = ss.read_table(log, belt_speed=0.09)
    assert set(faster.samples.belt_velocity) == {0.09}
    assert faster.measures.regime == "pure_slip"


def test_a_current_is_reported_as_a_force(stickslip: Run, tmp_path: Path) -> None:
    time = np.arange(2000) * 1e-3
    table = np.column_stack([time, 1e-3 * np.sin(20.0 * time), 1.5 * np.cos(20.0 * time)])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t,x,i [A]", comments="")
    given = ("report", "log.csv", "--columns", "time=t,position=x,force=#3")
    motor = ("--force-constant", "0.35Nm/A", "--pitch", "10mm")
    newtons = 1.5 * 0.35 * 2.0 * np.pi / 0.01
    assert stickslip.json(*given, *motor)["peak_force"] == pytest.approx(newtons, rel=1e-9)
    turns = stickslip.json(*given, *motor[:2], "--rotary")
    assert turns["peak_force"] == pytest.approx(1.5 * 0.35, rel=1e-9)
    for arguments, refusal in (
        (given, "is in A, which is no unit of force"),
        ((*given, *motor[:2]), "whose pitch is needed"),
        ((*given[:2], *motor), "--force-constant 0.35Nm/A: is for the current in a table"),
    ):
        done = stickslip(*arguments)
        assert done.returncode == 2
        assert refusal in done.stderr


def test_slips_are_told_one_by_one(stickslip: Run, tmp_path: Path) -> None:
    """A tooth each second, 1 mm high."""
    time = np.arange(8000) * 1e-3
    noise = 1e-6 * np.random.default_rng(1).standard_normal(8000)
    table = np.column_stack([time, 1e-3 * (time % 1.0) + noise])
    np.savetxt(tmp_path / "saw.csv", table, delimiter=",", header="t,x", comments="")
    given = ("saw.csv", "--columns", "time=t,position=x,belt_velocity=1e-3", "--slips", "1e-4")
    done = stickslip("report", *given, "--plot", "saw.png")
    assert done.returncode == 0, done.stderr
    assert "7 slips of more than 100 µm: stick-slip" in done.stdout
    assert "velocity while sticking" in done.stdout
    assert (tmp_path / "saw.png").stat().st_size > 10_000
    report = stickslip.json("report", *given)
    slips = report["slips"]
    assert slips["count"] == len(slips["each"]["drop"]) == 7
    assert slips["drop"]["mean"] == pytest.approx(1e-3, rel=0.01)
    assert slips["stick_velocity"]["mean"] == pytest.approx(1e-3, rel=0.01)
    assert slips["each"]["stick_time"][0] is None
    assert report["position_noise"] == pytest.approx(1e-6, rel=0.1)


def test_a_slip_time_of_any_size_is_taken(stickslip: Run, log: Path) -> None:
    for slip_time in ("1e-320", "1e7", "1e308"):
        done = stickslip("report", str(log), "--slips", "1e-5", "--slip-time", slip_time)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.long
def test_settings_of_matplotlib_change_no_figure(
    stickslip: Run,
    start_stickslip: Start,
    process_environment: dict[str, str],
    log: Path,
    tmp_path: Path,
) -> None:
    assert stickslip("report", log.name, "--plot", "usual.svg").returncode == 0
    process_environment |= {"MPLBACKEND": "Nonsense", "MATPLOTLIBRC": "/nowhere"}
    (tmp_path / "matplotlibrc").write_bytes(b"\xff\xfe")
    ended(start_stickslip("report", log.name, "--plot", "other.svg"), 0)
    assert (tmp_path / "usual.svg").read_bytes() == (tmp_path / "other.svg").read_bytes()
