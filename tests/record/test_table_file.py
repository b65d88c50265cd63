"""Tables of other machines as recordings: CSV and MAT files, and what is refused of them."""

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.measures.slips import SlipThreshold
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.table_columns import TableFormat
from stickslip_ros.record.table_file import is_table, read_table
from tests.record.runs import csv_of

TIME = np.arange(2001) * 1e-3
POSITION = 1e-4 * np.sin(20.0 * np.pi * TIME)
VELOCITY = 2e-3 * np.pi * np.cos(20.0 * np.pi * TIME)
COLUMNS = {"time": "t", "position": "x", "velocity": "v", "force": "u*2.5", "belt_velocity": "0.04"}


def test_a_csv_file_is_read_to_the_last_digit(tmp_path: Path) -> None:
    columns = {"x": POSITION, "v": VELOCITY, "u": POSITION * 1e6, "unused": TIME}
    recording = read_table(csv_of(tmp_path / "log.csv", t=TIME + 5.0, **columns), COLUMNS)
    samples, forces = recording.samples, recording.forces
    assert samples.stamp.tolist() == [1_000_000 * number for number in range(2001)]
    assert samples.position.tolist() == POSITION.tolist()
    assert samples.velocity.tolist() == VELOCITY.tolist()
    assert samples.belt_velocity.tolist() == [0.04] * 2001
    assert forces.force.tolist() == (POSITION * 1e6 * 2.5).tolist()
    units = "units: t: no known unit, taken as s; x: no known unit, taken as m; v: no known unit"
    assert recording.notes == (f"{units}, taken as m/s",)


@pytest.mark.process
def test_a_mat_file_gives_the_same_up_to_a_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    most = 4 * len(TIME) + 1 + 9
    monkeypatch.setattr("stickslip_ros.record.table_file._MOST_NUMBERS", most)
    path = tmp_path / "log.mat"
    table = {"t": TIME[:, None], "x": POSITION[None, :], "v": VELOCITY, "u": POSITION, "gain": 1e6}
    savemat(path, {**table, "name": "a machine", "other": np.eye(3)})
    recording = read_table(path, {**COLUMNS, "force": "u*gain*2.5"})
    assert recording.samples.position.tolist() == POSITION.tolist()
    assert recording.forces.force == pytest.approx(POSITION * 2.5e6, rel=1e-15)
    savemat(path, {"t": TIME, "pos_mm": POSITION * 1e3})
    recording = read_table(path, {"time": "t", "position": "pos_mm"})
    assert recording.samples.position == pytest.approx(POSITION, rel=1e-15)
    savemat(path, {**table, "name": "a machine", "other": np.eye(3)})
    monkeypatch.setattr("stickslip_ros.record.table_file._MOST_NUMBERS", most - 1)
    with pytest.raises(BagError, match=f"it has more than {most - 1} numbers"):
        read_table(path, COLUMNS)


def test_what_is_slower_than_the_stick_speed_sticks(tmp_path: Path) -> None:
    path = csv_of(tmp_path / "log.csv", t=TIME, x=POSITION, v=VELOCITY)
    columns = {"time": "t", "position": "x", "velocity": "v", "belt_velocity": "0.0"}
    assert report_of_recording(path, columns)["stick_fraction"] == 0.0
    assert report_of_recording(path, columns, stick_speed=1e-3)["stick_fraction"] > 0.05


def test_a_velocity_that_is_missing_is_a_difference(tmp_path: Path) -> None:
    path = csv_of(tmp_path / "log.csv", t=TIME, x=POSITION)
    recording = read_table(path, {"time": "t", "position": "x"})
    assert recording.samples.velocity[1:-1] == pytest.approx(VELOCITY[1:-1], abs=1e-5)
    missing = [note.partition(" is")[0] for note in recording.notes[1:]]
    assert missing == ["the velocity", "the belt velocity"]
    report = report_of_recording(path, {"time": "t", "position": "x"})
    assert report["amplitude"] == pytest.approx(1e-4, rel=1e-3)
    assert report["notes"] == list(recording.notes)


def test_cells_and_times_that_are_no_numbers_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,x\n0,1\n,2\n0.2,\n0.3,nan\n0.4,5\n")
    recording = read_table(path, {"time": "t", "position": "x"})
    assert recording.samples.stamp.tolist() == [0, 200_000_000, 300_000_000, 400_000_000]
    assert np.isnan(recording.samples.position).tolist() == [False, True, True, False]
    assert recording.samples.is_valid.tolist()[1:3] == [False, False]


def test_times_that_repeat_and_velocities_that_are_missing_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    time = (np.arange(40.0) + 0.3 * np.sin(np.arange(40.0))).tolist()
    lines = [f"{t},{10 * t},{10 if number % 4 else ''}" for number, t in enumerate(time)]
    path.write_text("\n".join(["t,x,v", *lines, lines[-1]]) + "\n")
    recording = read_table(path, {"time": "t", "position": "x", "velocity": "v"})
    assert recording.samples.velocity == pytest.approx(np.full(41, 10.0))
    for note in (
        "1 of 41 rows have the time of the row before",
        "10 rows have a position and no velocity: it is the difference of the positions",
    ):
        assert note in recording.notes


@pytest.mark.process
def test_rows_between_updates_of_a_column_are_left_out(tmp_path: Path) -> None:
    """An even feed is no stick-slip where its encoder comes over a slow bus."""
    time, path = np.arange(4000.0) / 1000.0, tmp_path / "log.npz"
    columns = {"x": 0.01 * np.repeat(time[::50], 50), "c": 0.01 * time, "scale": np.ones(1)}
    np.savez(path, t=np.where(time > 0.0, time, np.nan), **columns)
    report = report_of_recording(path, {"time": "t", "position": "c-x*scale"}, belt_speed=0.01)
    assert report["regime"] in ("equilibrium", "held")
    assert (report["samples"], report["lost_samples"]) == (79, 0)
    assert any("updated only every 50 rows" in note for note in report["notes"])


@pytest.mark.process
def test_rows_of_vectors_are_those_that_are_wanted(tmp_path: Path) -> None:
    path, columns = tmp_path / "log.mat", {"time": "log.t", "position": "log.x"}
    time, joint = np.repeat(np.arange(40.0), 2), np.tile([1.0, 2.0], 40)
    savemat(path, {"log": {"t": time, "x": time * joint, "joint": joint}, "rate": 7.0})
    found = read_table(path, columns, form=TableFormat(where="log.joint=2"))
    assert found.samples.position.tolist() == [2.0 * each for each in range(40)]
    with pytest.raises(InvalidInputError, match=r"has log.joint=3; column log.joint has 1, 2"):
        read_table(path, columns, form=TableFormat(where="log.joint=3"))


def test_only_tables_are_tables(tmp_path: Path) -> None:
    """A file without a known end is one unless it is a bag."""
    for name, content in (("table", b"t,x\n0,1\n"), ("bag", b"\x89MCAP0\r\n")):
        (tmp_path / name).write_bytes(content)
    for names, expected in (
        (("a/log.CSV", "log.mat", "log.txt", "table"), True),
        (("bags/reference", "reference_0.mcap", "log", "bag"), False),
    ):
        assert {is_table(tmp_path / name) for name in names} == {expected}


def test_columns_that_make_no_recording_are_refused(tmp_path: Path) -> None:
    path = csv_of(tmp_path / "log.csv", t=TIME, x=POSITION, v=VELOCITY)
    refusals: list[tuple[dict[str, str] | None, str]] = [
        ({"time": "t", "position": "y"}, "has no column 'y'"),
        ({"time": "t", "position": "x*"}, "the expression 'x*' is invalid"),
        ({"time": "t", "position": "y/2"}, "has no column 'y'"),
        ({"time": "t", "position": "nan"}, "no row has a time and a position"),
        ({"time": "t"}, "no column is given for position"),
        ({"time": "3", "position": "x"}, "time = 3 must be a column"),
        ({"time": "t", "position": "x", "speed": "v"}, "column speed is invalid"),
        ({"time": "t*1e12", "position": "x"}, "differ by more than 9e+09 s"),
        ({"time": "x", "position": "t"}, ": rows must be in the order of time"),
        ({"time": "t*nan", "position": "x"}, "no time is a finite number"),
        (None, "not those of `stickslip simulate --out`"),
    ]
    for columns, sentence in refusals:
        with pytest.raises(InvalidInputError) as refused:
            read_table(path, columns)
        assert sentence in str(refused.value)
        assert "\n" not in str(refused.value)


def stairs(rate: float, duration: float) -> tuple[Any, Any]:
    """A table of 10 kg that follows 10 mm/s on 4000 N/m, friction 29.43 N and 19.62 N."""
    speed, frequency, reach = 0.01, 20.0, 9.81 / 4000.0
    stick = 2.0 * reach / speed
    slip = (2.0 * np.pi - 2.0 * np.arctan(reach * frequency / speed)) / frequency
    time = np.arange(round(duration * rate)) / rate
    since = (time + 0.1) % (stick + slip)
    angle = frequency * (since - stick)
    slipping = reach * np.cos(angle) + speed / frequency * np.sin(angle)
    behind = np.where(since < stick, speed * since - reach, slipping)
    return time, speed * time - behind


def test_a_long_table_takes_little_more_memory_than_its_columns(tmp_path: Path) -> None:
    rows = 200_000
    path = tmp_path / "log.csv"
    time = 1e-3 * np.arange(rows)
    np.savetxt(path, np.column_stack([time, np.sin(time)]), "%.3f", ",", header="t,x", comments="")
    tracemalloc.start()
    recording = read_table(path, {"time": "t", "position": "x"})
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(recording.samples) == rows
    assert peak < 8 * 10 * rows


def test_a_table_on_a_guide_at_rest_has_the_measures_of_its_stick_slip(tmp_path: Path) -> None:
    time, position = stairs(500.0, 6.0)
    path = csv_of(tmp_path / "log.csv", t=time, x=position)
    report = report_of_recording(
        path, {"time": "t", "position": "x"}, slips=SlipThreshold(1e-3, within=0.1)
    )
    assert report["regime"] == "stick_slip"
    assert report["amplitude"] == pytest.approx(2.50295e-3, rel=0.01)
    assert report["frequency"] == pytest.approx(1.497698, rel=1e-4)
    assert report["stick_fraction"] == pytest.approx(0.734621, abs=0.01)
    assert report["slips"]["drop"]["median"] == pytest.approx(6.677e-3, rel=0.01)
    notes = report["notes"]
    assert any("advances at 10 mm/s on a guide at rest" in note for note in notes)
    assert any("6.677 mm in a cycle" in note for note in notes)
    assert any("the slips are rises" in note for note in notes)
    faster = np.append(3.0 * position, 3.0 * position[-1] + position)
    two = csv_of(tmp_path / "two.csv", t=np.append(time, time[-1] + 2e-3 + time), x=faster)
    report = report_of_recording(two, {"time": "t", "position": "x"})
    assert report["amplitude"] == pytest.approx(2.50295e-3, rel=0.01)
    assert any("of 12 s: before, the feed differs" in note for note in report["notes"])
    belt = {"time": "t", "position": "0.01*t-x", "belt_velocity": "0.01"}
    few = report_of_recording(path, belt, end=2.4)
    assert (few["regime"], few["stick_fraction"]) == ("stick_slip", None)
    assert any("needs three whole cycles, and there are 2" in note for note in few["notes"])
    notes = report_of_recording(path, {**belt, "position": "x*1e6"})["notes"]
    assert any("it diverges, or one of them is in another unit" in note for note in notes)


def test_coarse_data_do_not_tell_whether_it_sticks(tmp_path: Path) -> None:
    time, position = stairs(500.0, 6.0)
    path = csv_of(tmp_path / "log.csv", t=time, x=np.round((0.01 * time - position) * 1e3) / 1e3)
    belt = {"belt_velocity": "0.01"}
    report = report_of_recording(path, {"time": "t", "position": "x", **belt})
    assert (report["regime"], report["stick_fraction"]) == (None, None)
    assert report["amplitude"] == pytest.approx(2.5e-3, rel=0.15)
    reason = "the regime is not known: the positions do not tell"
    assert any(reason in note for note in report["notes"])


@pytest.mark.parametrize(
    ("name", "form", "newtons"),
    [
        ("i [A]", {"force_constant": "0.35Nm/A", "pitch": 0.01}, 0.35 * 2.0 * np.pi / 0.01),
        ("i [mA]", {"force_constant": "350 mNm/A", "pitch": 0.01}, 0.07 * np.pi),
        ("i", {"force_constant": "50N/A"}, 50.0),
        ("i", {"force_constant": "0.35 N m/A", "rotary": True}, 0.35),
    ],
)
def test_a_current_is_a_force_by_the_constant_of_the_motor(
    tmp_path: Path, name: str, form: Any, newtons: float
) -> None:
    path = csv_of(tmp_path / "log.csv", t=TIME, x=POSITION, **{name: TIME})
    columns = {"time": "t", "position": "x", "force": "#3"}
    recording = read_table(path, columns, form=TableFormat(**form))
    assert recording.forces.force == pytest.approx(TIME * newtons, rel=1e-12)
    assert "the force is #3, a current, times" in "; ".join(recording.notes)
    scaled = read_table(path, {**columns, "force": "#3*2"}, form=TableFormat(**form))
    in_amperes = 2.0 if "mA" not in name else 2e3  # a number takes the place of the unit
    assert scaled.forces.force == pytest.approx(TIME * newtons * in_amperes, rel=1e-12)


@pytest.mark.parametrize(
    ("form", "refusal"),
    [
        ({"force_constant": "0.35"}, "as 50N/A of a linear motor, or 0.35Nm/A"),
        ({"force_constant": "0N/A"}, "is invalid: must be a number above 0 with its unit"),
        ({"force_constant": "0.35Nm/A"}, "whose pitch is needed, .* N/A, a linear motor, may be"),
        ({"force_constant": "50N/A", "pitch": 0.01}, "which has no pitch .* N m/A, a motor with"),
        ({"force_constant": "50N/A", "rotary": True}, "turns no rotary axis"),
        ({"force_constant": "1Nm/A", "rotary": True, "pitch": 0.01}, "a rotary axis has no screw"),
        ({"pitch": 0.01}, "pitch = 0.01 is refused: it is for a force_constant"),
        ({"force_constant": "50N/A", "pitch": -1.0}, "pitch = -1.0 is invalid"),
    ],
)
def test_a_force_constant_must_fit_to_the_axis(form: Any, refusal: str) -> None:
    with pytest.raises(InvalidInputError, match=refusal):
        TableFormat(**form)


def test_a_current_and_a_force_are_not_confused(tmp_path: Path) -> None:
    columns, amperes = {"time": "t", "position": "x"}, TableFormat(force_constant="50N/A")
    table = {"i [A]": TIME, "F_N": TIME, "Motorstrom": TIME}
    path = csv_of(tmp_path / "log.csv", t=TIME, x=POSITION, **table)
    with pytest.raises(InvalidInputError, match="a current by its name, which tells no force"):
        read_table(path, {**columns, "force": "Motorstrom"})
    read_table(path, {**columns, "force": "Motorstrom*0.3"})
    with pytest.raises(InvalidInputError, match=r"is in A, .*--force-constant 0.35Nm/A with"):
        read_table(path, {**columns, "force": "#3"})
    with pytest.raises(InvalidInputError, match="is in N, which is no unit of a current"):
        read_table(path, {**columns, "force": "F_N"}, form=amperes)
    with pytest.raises(InvalidInputError, match="no column is given for force"):
        read_table(path, columns, form=amperes)
