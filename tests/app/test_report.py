"""`stickslip report` and `repair` of bags: values, sentences, figures."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped

import stickslip_ros as ss
from stickslip_ros.testing import ClosedLoop
from tests.app.conftest import REFERENCE, Run, Start, ended
from tests.record.runs import STAMPS, STATES, record, state, write_bag
from tests.testing.controllers import WithoutArguments


def texts(picture: Path) -> list[str]:
    return [element.text for element in ElementTree.parse(picture).iter() if element.text]


def forces_in(report: str) -> dict[str, str]:
    """Return the rows of the control force."""
    rows = [line.split("  ") for line in report.splitlines() if "force" in line]
    return {row[0]: row[-1].strip() for row in rows if "control force" in row[0]}


def test_runs_are_set_side_by_side(stickslip: Run, tmp_path: Path) -> None:
    record(tmp_path / "first")
    record(tmp_path / "second", states=STAMPS[:500])
    bags = "first", "second"
    out = stickslip("report", *bags).stdout
    assert out.index("first") < out.index("second")
    (row,) = (line for line in out.splitlines() if line.startswith("samples"))
    assert row.split()[-2:] == ["1000", "500"]
    part = ("report", *bags, "--from", "1", "--to", "4")
    reports = stickslip.json(*part)["reports"]
    assert [report["bag"] for report in reports] == [*bags]
    assert [report["samples"] for report in reports] == [300, 300]
    assert stickslip.json(*part, "--plot", "runs.svg")["reports"] == reports
    shown = texts(tmp_path / "runs.svg")
    assert "Runs compared, first; second" in shown
    assert shown.count("first") >= 2  # above its column, and in the legend


def test_bags_of_an_analyzer_that_was_restarted_are_one_run(stickslip: Run, tmp_path: Path) -> None:
    tables = {"stickslip_ros/analyzer": {"bag": '"run"', "bag_exists": '"next"'}}
    parts = {"run": STAMPS[:400], "run_2": STAMPS[450:700], "run_3": STAMPS[700:], "run_4": STAMPS}
    for name, stamps in parts.items():
        messages = [(STATES, stamp, state(stamp)) for stamp in stamps]
        write_bag(tmp_path / name, messages, tables=tables)
    run = stickslip.json("report", "run", "run_2", "run_3")
    assert (run["samples"], run["lost_samples"], run["duration"]) == (950, 50, 9.48)
    assert run["amplitude"] == pytest.approx(3.0, rel=1e-3)
    assert run["notes"] == [
        "run_2 continues the run 510 ms after the bag before it",
        "run_3 continues the run 10 ms after the bag before it",
    ]
    # From its beginning again it is another run, and so is one that others have recorded.
    assert len(stickslip.json("report", "run_3", "run_2")["reports"]) == 2
    assert len(stickslip.json("report", "run", "run_4")["reports"]) == 2
    record(tmp_path / "other", STAMPS[:400])
    record(tmp_path / "other_2", STAMPS[400:])
    assert len(stickslip.json("report", "other", "other_2")["reports"]) == 2


def test_late_forces_are_shown_where_they_are_counted(stickslip: Run, tmp_path: Path) -> None:
    counts = {"samples": "1000", "late_forces": "617", "missed_deadlines": "0"}
    record(tmp_path / "late", tables={"stickslip_ros/timing": counts})
    record(tmp_path / "old")
    late, old = (stickslip("report", bag).stdout for bag in ("late", "old"))
    rows = dict(line.split("  ", 1) for line in late.splitlines() if "  " in line)
    assert rows["regime"].endswith(", doubtful: late forces")
    assert (rows["late forces"].strip(), rows["missed deadlines"].strip()) == ("617", "0")
    assert not [word for word in ("doubtful", "late", "missed deadlines") if word in old]


def test_a_picture_changes_nothing_of_the_report(stickslip: Run, tmp_path: Path) -> None:
    plain = stickslip.json("report", REFERENCE)
    assert (plain["steady"], plain["trend"]) == (False, "decaying")
    assert plain["peak_force"] == pytest.approx(114.87062132727189)
    for name in ("peak_applied_force", "resting_applied_force", "dropped_forces"):
        assert plain[name] is None  # the bag does not tell what was dropped
    assert stickslip.json("report", REFERENCE, "--plot", "run.svg") == plain
    shown = texts(tmp_path / "run.svg")
    assert "amplitude (µm)" in shown
    assert REFERENCE in " ".join(shown)
    assert any("stick-slip, not steady: decaying, amplitude 325.8 µm" in text for text in shown)
    assert {"friction law, with the range of this run", "each cycle"} <= set(shown)
    done = stickslip("report", REFERENCE)
    assert "stick-slip, not steady: decaying\n" in done.stdout
    assert [*forces_in(done.stdout)] == ["peak control force", "final control force"]


def test_what_a_bag_lacks_is_said(stickslip: Run, tmp_path: Path) -> None:
    record(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    done = stickslip("report", "bag", "--plot", "run.svg")
    assert done.returncode == 0
    assert done.stdout.splitlines()[-1].startswith("metadata.yaml is missing")
    shown = texts(tmp_path / "run.svg")
    assert any(text.startswith("metadata.yaml is missing") for text in shown)
    assert "it is not recorded what drive it was: no equilibrium, no friction law" in shown


def test_a_bag_whose_law_is_gone_is_reported_as_one_of_a_law_with_a_memory(
    stickslip: Run, tmp_path: Path
) -> None:
    printed: list[str] = []
    for law, page in (("rate_state", ("--html", "run.html")), ("lugre", ())):
        plant = {"friction.law": f'"{law}"', "mass": "1.0", "stiffness": "10.0", "rate": "100.0"}
        record(tmp_path / law, tables={"stickslip_ros/plant": plant})
        done = stickslip("report", law, *page)
        assert done.returncode == 0, done.stderr
        printed.append(done.stdout.partition("\n")[2])
    assert printed[0] == printed[1]
    assert "rate_state" in (tmp_path / "run.html").read_text(encoding="utf-8")


class Refused(WithoutArguments):
    """Answers each state with 128.6 N that no plant takes."""

    def answer(self, state):
        message = WrenchStamped(header=state.header)
        message.header.stamp.nanosec += 1
        message.wrench.force.x = 128.6
        self.force.publish(message)


def test_of_forces_that_were_all_refused_none_acted(stickslip: Run, tmp_path: Path) -> None:
    impatient = "plant.reply_timeout=0.1"
    with ClosedLoop("feed_drive", impatient, controller=Refused, bag=tmp_path / "bag") as loop:
        result = loop.run(0.5)
    assert (result.peak_force, result.peak_applied_force) == (128.6, 0.0)
    assert len(result.dropped_forces.stamp) == len(result.forces.stamp) > 1
    report = stickslip.json("report", "bag")
    assert (report["peak_force"], report["resting_force"]) == (128.6, 128.6)
    assert (report["peak_applied_force"], report["resting_applied_force"]) == (0.0, 0.0)
    assert report["dropped_forces"] == len(result.forces.stamp)
    text = stickslip("report", "bag").stdout
    rows = forces_in(text)
    assert rows["peak control force sent"] == "128.6 N"
    assert rows["peak control force acting"] == rows["final control force acting"] == "0 N"
    assert ["dropped", "forces", f"{report['dropped_forces']}"] in map(str.split, text.splitlines())


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
    for slip_time in ("1e-320", "1e308"):  # any above 0 is taken
        assert stickslip("report", *given, "--slip-time", slip_time).returncode == 0


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
