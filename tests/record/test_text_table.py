"""The forms of tables as text: each is found, read to the last digit, and said."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.record.table_columns import ANY_FORM, TableFormat
from stickslip_ros.record.table_file import TableRecording, read_table

TIME = np.arange(200) * 5e-4
POSITION = np.round(1e-3 * np.sin(40.0 * TIME), 9)


def rows(separator: str = ",", comma: bool = False, quote: str = "", last: str = "") -> str:
    cells = zip([f"{each:.4f}" for each in TIME], [f"{each:.9f}" for each in POSITION], strict=True)
    lines = [separator.join(f"{quote}{cell}{quote}" for cell in row) + last for row in cells]
    text = "\n".join(lines) + "\n"
    return text.replace(".", ",") if comma else text


def read(
    folder: Path, text: str | bytes, time: str, position: str, form: TableFormat = ANY_FORM
) -> TableRecording:
    path = folder / "log.txt"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path, {"time": time, "position": position}, 0.01, form)


@pytest.mark.parametrize(
    ("text", "time", "position"),
    [
        ("t,x\n" + rows(), "t", "x"),
        ("t;x\n" + rows(";", comma=True), "t", "x"),
        ("t\tx\n" + rows("\t", comma=True), "t", "x"),
        ("t x\n" + rows("  ", comma=True), "t", "x"),
        ("t|x\n" + rows("|"), "t", "x"),
        ("t,x\n" + rows(",", quote='"'), "t", "x"),
        ("t,x\n" + rows(";", True, '"').replace(";", ","), "t", "x"),
        ("t;x;\n" + rows(";", last=";"), "t", "x"),
        ("t;x\n" + rows(";", last=";"), "t", "x"),
        ("t, x\n" + rows(", "), "t", "x"),
        ("# t x\n" + rows(" "), "t", "x"),
        (rows(), "#1", "#2"),
        ("Rate;2000\nOperator: A, B; C\n\nt;x\ns;m\n" + rows(";", comma=True), "t", "x"),
        ("Start\t13\n\nName\tPos\nUnit\tm\n\n" + rows("\t"), "#1", "Pos"),
        ("Name,A,Name,B\nType,R,Type,R\nStep,2,Step,2\nNetID,5.1,NetID,5.1\n\n"
         + rows(",", last=",0,0"), "Name", "A"),
        ("t;x\n-;-\n" + rows(";"), "t", "x"),
        ("".join(f"t {row.replace(',', ' V ')}\n" for row in rows().splitlines()), "t", "V"),
        ("% t [s]  x [m]\n" + rows("  "), "t", "x"),
        ("".join(f"t {a} s x {b} m\n" for a, b in (row.split() for row in rows(" ").splitlines())),
         "t", "x"),
        ("t [s];x [m]\n" + rows(";"), "t", "x"),
        ("cmd-x,x\n" + rows(), "cmd-x", "x"),
        (("t;µ\n" + rows(";")).encode("cp1252"), "t", "µ"),
        (("время, с;x\n" + rows(";")).encode("cp1251"), "время", "x"),
        (("t;бД\n" + rows(";")).encode("cp1251"), "t", "бД"),
        (b"T;X \xcc\xcc\n" + rows(";").encode(), "T", "'X \u041c\u041c'*1"),
        (b"T \xcc\xd1;x\n" + rows(";").encode(), "'T \u041c\u0421'*1", "x"),
        ('"t\n[s]","x"\n' + rows(), "t [s]", "x"),
        ('# 5" stroke\r\n"Zeit\r\n(s)";"Weg\n\n(m)"\r\n' + rows(";"), "Zeit (s)", "Weg  (m)"),
        (("t;Größe\n" + rows(";")).encode("cp1252"), "t", "Größe"),
        (("t;posição\n" + rows(";")).encode("cp1252"), "t", "posição"),
        (("t;x\n" + rows(";")).encode("utf-16"), "t", "x"),
        (("t;x\n" + rows(";")).encode("utf-16-le"), "t", "x"),
        (("t;x\r\n" + rows(";").replace("\n", "\r\n")).encode("utf-8-sig"), "t", "x"),
    ],
)  # fmt: skip
def test_the_form_of_a_table_is_found(
    tmp_path: Path, text: str | bytes, time: str, position: str
) -> None:
    samples = read(tmp_path, text, time, position).samples
    assert samples.stamp.tolist() == [500_000 * number for number in range(200)]
    assert samples.position.tolist() == POSITION.tolist()


@pytest.mark.parametrize(
    ("before", "sentence"),
    [
        ("x [mm]", "units: x [mm]: mm"),
        ("x, mm", "units: x, mm: mm"),
        ("x (deg)", "deg is of a rotary axis: what is in m is in rad, as --rotary shows"),
    ],
)
def test_a_unit_is_used_for_a_column_by_itself_and_said(
    tmp_path: Path, before: str, sentence: str
) -> None:
    text = f"t,{before}\n" + rows()
    found = read(tmp_path, text, "t", before)
    assert any(sentence in note for note in found.notes)
    scale = np.pi / 180.0 if "deg" in before else 1e-3
    assert found.samples.position == pytest.approx(POSITION * scale)
    by_number = read(tmp_path, text, "#1", "#2")
    assert by_number.samples.position.tolist() == found.samples.position.tolist()
    as_said = read(tmp_path, text, "t", f"'{before}'*1.0")
    assert as_said.samples.position.tolist() == POSITION.tolist()


@pytest.mark.parametrize(
    ("name", "position", "way"),
    [
        ("x [inc]", "x [inc]", "is in inc, which is no unit of position: position=#2*NUMBER"),
        ("x_in", "#2", "in in (0.0254 m) or m (1 m): position=#2*0.0254 or position=#2*1 says"),
        ("accel_x", "#2", "is an acceleration by its name, which tells no position: position=#2*1"),
        ("x [mm]", "#2-t [s]", "is in s, which is no unit of position: position=(#2-t [s])*NUMBER"),
    ],
)
def test_a_unit_that_is_not_sure_is_refused_with_a_way(
    tmp_path: Path, name: str, position: str, way: str
) -> None:
    text = f"t [s],{name}\n" + rows()
    with pytest.raises(InvalidInputError, match=re.escape(way)):
        read(tmp_path, text, "#1", position)
    samples = read(tmp_path, text, "#1", "#2*0.0254").samples
    assert samples.position == pytest.approx(0.0254 * POSITION)


def test_a_difference_of_columns_has_their_unit(tmp_path: Path) -> None:
    lines = [f"{t:.4f},{1e3 * x + 2:.9f},2" for t, x in zip(TIME, POSITION, strict=True)]
    text = "t,act [mm],cmd [mm]\n" + "\n".join(lines)
    found = read(tmp_path, text, "t", "act-cmd").samples.position
    assert found == pytest.approx(POSITION, abs=1e-12)
    with pytest.raises(
        InvalidInputError, match=r"of different units, act \[mm\] in mm, cmd \[m\] in m:"
    ):
        read(tmp_path, text.replace("cmd [mm]", "cmd [m]"), "t", "act-cmd")


def test_units_of_a_rotary_axis_are_asked_for(tmp_path: Path) -> None:
    text = "t,x [mm],phi [deg]\n" + "".join(f"{n},{n},{n}\n" for n in range(20))
    form = TableFormat(rotary=True)
    found = read(tmp_path, text, "t", "phi", form)
    assert not any("rotary" in note for note in found.notes)
    with pytest.raises(InvalidInputError, match="no unit of position of a rotary axis"):
        read(tmp_path, text, "t", "x", form)


def test_times_of_day_have_no_unit(tmp_path: Path) -> None:
    text = "Time / hh:mm:ss.ms,x\n" + "".join(f"10:00:00.{n:03d},{n}\n" for n in range(50))
    stamps = read(tmp_path, text, "#1", "x").samples.stamp
    assert stamps.tolist() == [1_000_000 * number for number in range(50)]


@pytest.mark.parametrize(
    ("top", "time", "position", "form", "note"),
    [
        ("Trace 1\nms;mm\nt;x\n", "t", "x", ANY_FORM, "the first line skipped, units in line 2"),
        ("t [ms];x [mm]\n", "#1", "#2", TableFormat(skip=1), "semicolons as separators"),
        ("Zeit;Weg\nms;mm ±1 µm\n", "Zeit", "Weg", ANY_FORM, "decimal commas, units in line 2"),
        ("# t in ms; x [mm]\nt;x\n", "t", "x", ANY_FORM, "decimal commas"),
        ("# Einheiten: Zeit ms; Weg mm\nZeit;Weg\n", "Zeit", "Weg", ANY_FORM, "the first line"),
        ("% x: position in mm\n% t: ms\nt;x\n", "t", "x", ANY_FORM, "the first 2 lines skipped"),
        ("Čas v ms, poloha v mm\nčas;poloha\n", "čas", "poloha", ANY_FORM, "the first line"),
        ("Zeit [ms];Weg [mm]\n-;%\n", "Zeit", "Weg [mm]*1e-3", ANY_FORM, "units in line 2"),
    ],
)
def test_units_above_and_below_the_names_and_of_skipped_names_are_used(
    tmp_path: Path, top: str, time: str, position: str, form: TableFormat, note: str
) -> None:
    text = top + "".join(f"{n / 2:g};{n}\n" for n in range(50))
    found = read(tmp_path, text.replace(".", ","), time, position, form)
    assert found.samples.stamp.tolist() == [500_000 * number for number in range(50)]
    assert found.samples.position == pytest.approx(1e-3 * np.arange(50.0))
    assert note in found.notes[0]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("All lengths in mm, times in s", "by the line 'All lengths in mm, times in s' above, may"),
        ("units: V, kN, mm", "may be in mm (0.001 m) or m (1 m): position=#2*0.001 or position=#2"),
        ("x/mm y/mm", "may be in mm (0.001 m)"),
        ("unit = inch", "may be in inch (0.0254 m)"),
        ("x: encoder counts", "is in counts, which is no unit of position"),
        ("stroke 20 mm, feed (mm/min): 5", "x: no known unit, taken as m, below the line 'stroke"),
        ("units: s, V", "x: no known unit, taken as m, below the line 'units: s, V'"),
        ('"Length unit:","cm"', "above, may be in cm (0.01 m)"),
        ("2024-05-01 10:00:00 machine 3, load 12 kg, sampled at 1 kHz", ""),
        ("Operator: A. Smith, h = 12 d, turn off the yard light; position in m, time in s", ""),
    ],
)
def test_units_in_lines_above_are_asked_for_or_said(tmp_path: Path, line: str, said: str) -> None:
    text = f"# {line}\nt,x\n" + rows()
    if "may" in said or " is " in said or "inch" in said:
        with pytest.raises(InvalidInputError, match=re.escape(said)):
            read(tmp_path, text, "t", "x")
    else:
        assert said in "".join(read(tmp_path, text, "t", "x").notes[1:2])
        assert len(read(tmp_path, text, "t", "x").notes) == 3
    assert read(tmp_path, text, "t", "x*1").samples.position.tolist() == POSITION.tolist()


@pytest.mark.parametrize(
    "form",
    [
        "2026-06-01T10:00:{:06.3f}",
        "2026-06-01 10:00:{:06.3f}Z",
        "2026-06-01T10:00:{:06.3f}+02:00",
        "01.06.2026 10:00:{:06.3f}",
        "10:00:{:06.3f}",
        "10:{:06.3f}",
    ],
)
@pytest.mark.parametrize("separator", [",", ";"])
def test_times_of_the_clock_are_seconds(tmp_path: Path, form: str, separator: str) -> None:
    lines = [f"{form.format(number * 1e-3)}{separator}{number}" for number in range(50)]
    text = f"t{separator}x\n" + "\n".join(lines)
    if separator == ";":
        text = text.replace(".0", ",0") if form[2] != "." else text
    samples = read(tmp_path, text, "t", "x").samples
    assert samples.stamp.tolist() == [1_000_000 * number for number in range(50)]


def test_a_clock_goes_on_at_midnight(tmp_path: Path) -> None:
    """Also beside a date, and with milliseconds behind a semicolon, as Rockwell writes them."""
    times = ("23:59:59;800", "23:59:59;900", "00:00:00;000", "00:00:00;100")
    text = "".join(f"06/01/2026,{time},{n}.5\n" for n, time in enumerate(times))
    assert read(tmp_path, text, "#2", "#3").samples.stamp[3] == 300_000_000
    text = "t,x\n23:59:59.8,1\n23:59:59.9,2\n00:00:00.0,3\n00:00:00.1,4\n"
    stamps = read(tmp_path, text, "t", "x").samples.stamp
    assert stamps.tolist() == [100_000_000 * number for number in range(4)]


def test_seconds_and_nanoseconds_lose_nothing(tmp_path: Path) -> None:
    ns = 1_700_000_000_123_456_789 + 1_000_003 * np.arange(2000)
    lines = [f"{each // 10**9},{each % 10**9},{each},1" for each in ns.tolist()]
    text = "sec,nanosec,stamp,x\n" + "\n".join(lines)
    for time in ("sec+nanosec*1e-9", "stamp*1e-9"):
        assert read(tmp_path, text, time, "x").samples.stamp.tolist() == (ns - ns[0]).tolist()


def test_times_that_are_rounded_are_taken_as_even(tmp_path: Path) -> None:
    for period, name in ((5e-4, "500 µs"), (1.5e-3, "1.5 ms")):
        lines = [f"{period * n + 1e-9:.3f},{n}" for n in range(500) if not 200 <= n < 240]
        found = read(tmp_path, "t,x\n" + "\n".join(lines), "t", "x")
        assert any("rounded to 1 ms" in note and name in note for note in found.notes)
        steps = np.diff(found.samples.stamp[:200])
        assert np.abs(steps - period * 1e9).max() <= 1


def test_gaps_and_lost_rows_are_no_rounding(tmp_path: Path) -> None:
    for lost in ({300}, {*range(200, 260)}, {*range(7, 500, 60)}):
        lines = [f"{1e-3 * n:.3f},{n}" for n in range(500) if n not in lost]
        found = read(tmp_path, "t,x\n" + "\n".join(lines), "t", "x")
        kept = {10**6 * n for n in range(500) if n not in lost}
        assert set(found.samples.stamp.tolist()) == kept


def test_rounded_times_of_an_uneven_clock_are_said(tmp_path: Path) -> None:
    time = np.cumsum(np.random.default_rng(1).uniform(2e-3, 8e-3, 500))
    for digits, said in ((3, True), (6, False)):
        lines = [f"{each:.{digits}f},{each}" for each in time.tolist()]
        notes = read(tmp_path, "t,x\n" + "\n".join(lines), "t", "x").notes
        assert any("the times are multiples of 1 ms" in note for note in notes) == said
        assert any("velocities err by 20%" in note for note in notes) == said


def test_the_names_are_between_the_values(tmp_path: Path) -> None:
    lines = [f"\naxis.0.f-error {x:+.9f} axis.0.vel {n % 7:+d} " for n, x in enumerate(POSITION)]
    path = tmp_path / "halscope.log"
    path.write_text("Sampling period is 500000 ns \n" + "".join(f"{line}\n" for line in lines))
    for position in ("axis.0.f-error", "#1"):
        found = read_table(path, {"position": position})
        assert found.samples.position.tolist() == POSITION.tolist()
        assert found.samples.stamp.tolist() == [500_000 * number for number in range(200)]
    assert "the names in each row: axis.0.f-error, axis.0.vel" in found.notes[0]
    assert "the rows have no time: by a line above them they are 500 µs apart" in found.notes


def test_a_table_without_times_needs_a_period(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_text("".join(f"{x:.9f}\n" for x in POSITION))
    found = read_table(path, {"position": "#1"}, form=TableFormat(period=5e-4))
    assert found.samples.position.tolist() == POSITION.tolist()
    assert found.samples.stamp.tolist() == [500_000 * number for number in range(200)]
    path.write_text("t,x\n" + rows())
    with pytest.raises(InvalidInputError, match="no column is given for time; --period gives"):
        read_table(path, {"position": "x"})
    with pytest.raises(InvalidInputError, match="period is for a table without times"):
        read_table(path, {"time": "t", "position": "x"}, form=TableFormat(period=5e-4))


def test_times_are_in_the_unit_of_the_period_on_top(tmp_path: Path) -> None:
    top = "SampleTime[ms]\t2\tSampleTime[ms]\t2\n\n"
    body = "".join(f"{2 * n}\t{n}\t{2 * n}\t0\n" for n in range(50))
    found = read(tmp_path, top + body, "#1", "#2")
    assert found.samples.stamp.tolist() == [2_000_000 * number for number in range(50)]
    assert "the time is converted: steps of 2 are 2 ms by a line above" in found.notes
    found = read(tmp_path, body, "#1", "#2")
    assert any("no unit and counts in s, 2 s from row to row" in note for note in found.notes)
    numbered = "Sample rate;500;Hz\nrow;x\n" + "".join(f"{n};{n}\n" for n in range(50))
    assert read(tmp_path, numbered, "row", "x").samples.stamp[1] == 2_000_000


@pytest.mark.parametrize(
    ("row", "time", "refusal", "way"),
    [
        ("{},0", "#1", "no date in s: time=#1*NUMBER converts it, with 0.001 from ms", "#1*0.001"),
        ("10:00:00,{:.3}", "T+ms", "different units, the clock in s, ms in ms", "T+ms*0.001"),
    ],
)
def test_times_in_other_units_than_seconds_are_refused_with_a_way(
    tmp_path: Path, row: str, time: str, refusal: str, way: str
) -> None:
    stamps = (f"{1_770_000_000_000 + n}" for n in range(90))
    lines = [row.format(each if "10:" not in row else each[-3:]) for each in stamps]
    text = "T,ms,x\n" + "".join(f"{line},{n}\n" for n, line in enumerate(lines))
    with pytest.raises(InvalidInputError, match=re.escape(refusal)):
        read(tmp_path, text, time, "x")
    found = read(tmp_path, text, way, "x").samples
    assert found.stamp.tolist() == [1_000_000 * number for number in range(90)]


def test_days_are_refused_with_a_way(tmp_path: Path) -> None:
    text = "T,x\n" + "".join(f"{46_000.5 + n * 1e-3 / 86_400:.13f},{n}\n" for n in range(90))
    with pytest.raises(InvalidInputError, match=r"as days have: time=#1\*86400 converts it"):
        read(tmp_path, text, "T", "x")
    stamps = read(tmp_path, text, "#1*86400", "x").samples.stamp
    assert np.abs(stamps - 1_000_000 * np.arange(90)).max() < 2000


def test_points_between_thousands_are_refused_with_a_way(tmp_path: Path) -> None:
    cells = [f"{n:,}".replace(",", ".") for n in range(1050, 900, -1)]
    text = "t;x\n" + "".join(f"{n};{each}\n" for n, each in enumerate(cells))
    with pytest.raises(BagError, match=r"--decimal , takes it as that, and --decimal \. as it is"):
        read(tmp_path, text, "t", "x")
    for mark, first in ((",", 1050.0), (".", 1.05)):
        found = read(tmp_path, text, "t", "x", TableFormat(decimal=mark)).samples
        assert found.position[0] == first


def test_a_position_that_is_not_recorded_is_the_integral_of_the_velocity(tmp_path: Path) -> None:
    lines = [f"{n * 1e-3:.3f},{'' if n == 50 else 600 * n}" for n in range(100)]
    path = tmp_path / "log.csv"
    path.write_text("t,n [1/min]\n" + "\n".join(lines))
    columns = {"time": "t", "velocity": "#2"}
    found = read_table(path, columns, form=TableFormat(rotary=True))
    turn = 2.0 * np.pi
    assert found.samples.velocity[7] == pytest.approx(70.0 * turn)
    known = found.samples[found.samples.is_valid]
    assert len(known) == 99
    assert known.position[-1] == pytest.approx(0.5 * 10.0 * turn * 99**2 * 1e-3)
    assert "the position is not recorded: it is the integral of the velocity" in found.notes


def test_rows_of_one_joint_are_read(tmp_path: Path) -> None:
    joints = [*enumerate(("arm", "7", "x = y"))]
    lines = [f"{n * 1e-3:.3f},{name},{n + 10 * k}" for n in range(90) for k, name in joints]
    path, columns = tmp_path / "log.csv", {"time": "t", "position": "x"}
    path.write_text("t,joint,x\n\n" + "\n".join(lines).replace("5,arm,55", "5,arm,-"))
    with pytest.raises(InvalidInputError, match="joint is arm and 7 and x = y: --where 'joint"):
        read_table(path, columns)
    for number, name in enumerate(("arm", "7.0")):
        found = read_table(path, columns, form=TableFormat(where=f"joint={name}"))
        same = found.samples.position == np.arange(90.0) + 10.0 * number
        assert np.count_nonzero(same) == 90 - (not number)
        assert any("the first is line 168" in note for note in found.notes) == (not number)
    for where, sentence in (
        ("joint=leg", "no row has joint=leg; column joint has arm, 7, x = y"),
        ("axis=arm", "must be COLUMN=VALUE, with one of t, joint, x"),
    ):
        with pytest.raises(InvalidInputError, match=sentence):
            read_table(path, columns, form=TableFormat(where=where))


def test_sessions_are_read_one_by_one(tmp_path: Path) -> None:
    times = [*range(40), *range(9)]
    lines = [f"{t},{n},{t + 0.5},{-n}" for n, t in enumerate(times)]
    path, columns = tmp_path / "log.csv", {"time": "Name", "position": "x", "force": "F"}
    path.write_text("Name,x,Name,F\n" + "\n".join(lines))
    with pytest.raises(InvalidInputError, match="line 42, where a session of its own starts: --"):
        read_table(path, columns)
    found = read_table(path, columns, form=TableFormat(session=2))
    assert found.samples.position.tolist() == [*range(40, 49)]
    assert found.samples.stamp.tolist() == [10**9 * number for number in range(9)]
    with pytest.raises(InvalidInputError, match=r"session = 3 is invalid: .* has 2"):
        read_table(path, columns, form=TableFormat(session=3))


@pytest.mark.parametrize(
    ("times", "time", "way"),
    [
        ([(86_399_990 + n) % 86_400_000 for n in range(40)], "t [ms]", "#1, 86400000)*0.001"),
        ([(65_500 + n) % 65_536 for n in range(80)], "#1*1e-3*1", "#1*1e-3*1, 65.536)"),
    ],
)
def test_times_that_go_back_are_refused_with_a_way(
    tmp_path: Path, times: list[Any], time: str, way: str
) -> None:
    text = "t [ms];x\n" + "".join(f"{each};{n}\n" for n, each in enumerate(times))
    with pytest.raises(InvalidInputError, match=re.escape(way)) as refused:
        read(tmp_path, text, time, "x")
    found = read(tmp_path, text, str(refused.value).partition("time=")[2], "x").samples
    assert found.stamp.tolist() == [1_000_000 * number for number in range(len(times))]


def test_a_comma_means_the_same_in_all_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of positions in parts the first one tells nothing: 1,234 counts is no 1.234."""
    monkeypatch.setattr("stickslip_ros.record.text_table._CHUNK", 60)
    cells = [f"{each:,}" for each in range(1200, 1300)] + [f"{each:,}.5" for each in range(99)]
    text = "t;x;\n" + "".join(f"{n};{each};a\n" for n, each in enumerate(cells))
    found = read(tmp_path, text.replace(".5", ",5").replace("1,", "1.", 100), "t", "x")
    assert found.samples.position[[0, 100]].tolist() == [1200.0, 0.5]


def test_a_counter_that_wraps_once_is_refused_with_the_expression(tmp_path: Path) -> None:
    counts = [(2**32 - 900 + 20 * max(0, n - 50) * (n > 80)) % 2**32 for n in range(200)]
    text = "t,n\n" + "".join(f"{n * 1e-3:.3f},{each}\n" for n, each in enumerate(counts))
    with pytest.raises(InvalidInputError, match="as of a counter that wraps") as refused:
        read(tmp_path, text, "t", "n*1e-9")
    said = str(refused.value).partition("position=")[2]
    assert np.ptp(read(tmp_path, text, "t", said).samples.position) == pytest.approx(2980e-9)


@pytest.mark.parametrize(
    ("names", "row", "time", "position"),
    [
        ("t,x,F\n", "{ms} ms,{mm} mm,3.0", "t", "x"),
        ("t\tx\n", "{ms}ms\t{mm}mm", "t", "x"),
        ("t;x;F\n", "{s} sec;{mm} mm;3.0 N", "t", "x"),
        ("Length,4.0e3,,-0.0005,0.0\n", ",,,{s},{x}", "#4", "#5"),  # an oscilloscope
    ],
)
def test_units_stand_behind_values_and_empty_columns_count(
    tmp_path: Path, names: str, row: str, time: str, position: str
) -> None:
    lines = [
        row.format(ms=f"{1e3 * t:.10g}", s=f"{t:.10g}", mm=f"{1e3 * x:.15g}", x=f"{x:.15g}")
        for t, x in zip(TIME.tolist(), POSITION.tolist(), strict=True)
    ]
    found = read(tmp_path, names + "\n".join(lines), time, position).samples
    assert found.position[-len(TIME) :] == pytest.approx(POSITION, rel=1e-9)
    assert (np.diff(found.stamp) == 500_000).all()


def test_differences_of_decimals_do_not_jump(tmp_path: Path) -> None:
    commands = [(n, 4e-5 * min(n, 2500)) for n in range(3000)]
    lines = [f"{n * 2e-3:.4f},{cmd:.8f},{cmd - 4e-5:.8f}" for n, cmd in commands]
    found = read(tmp_path, "t,cmd,act\n" + "\n".join(lines), "t", "cmd-act")
    (note,) = found.notes[1:]
    assert note == "the velocity is not recorded: it is the difference of the positions"


def test_a_table_that_gives_no_sample_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,x,b\n0,1,\n1,2,\n2,,3\n")
    with pytest.raises(InvalidInputError, match="no position has a number of belt_velocity"):
        read_table(tmp_path / "log.csv", {"time": "t", "position": "x", "belt_velocity": "b"})


def test_a_channel_has_times_of_its_own(tmp_path: Path) -> None:
    lines = [f"{n},{n},{n + 0.5},{10 * n}" for n in range(20)]
    path = tmp_path / "log.csv"
    path.write_text("Name,Pos,Name,F\n" + "\n".join(lines))
    found = read_table(path, {"time": "Name", "position": "Pos", "force": "F"})
    assert found.forces.force[1:].tolist() == [10.0 * n for n in range(19)]
    assert any("times of its own" in note for note in found.notes)


def test_rows_between_those_of_the_positions_count(tmp_path: Path) -> None:
    lines = [f"{n * 1e-3:.3f},{n if n % 2 else ''},{'' if n % 2 else -n}" for n in range(100)]
    path = tmp_path / "log.csv"
    path.write_text("t,x,u\n" + "\n".join(lines))
    found = read_table(path, {"time": "t", "position": "x", "force": "u"})
    valid = found.samples[found.samples.is_valid]
    assert valid.velocity == pytest.approx(np.full(50, 1000.0))
    assert found.forces.force[1::2].tolist() == [-2.0 * n for n in range(50)]
    belt = read_table(path, {"time": "t", "position": "x", "belt_velocity": "u"}).samples
    assert belt.belt_velocity[1:98:2] == pytest.approx(-np.arange(1.0, 98.0, 2.0))


def test_a_table_is_longer_than_what_is_looked_at_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip_ros.record.text_form._HEAD", 500)
    assert len(read(tmp_path, "t,x\n" + rows(), "t", "x").samples) == 200
    monkeypatch.setattr("stickslip_ros.record.text_form._LARGEST", 600)
    with pytest.raises(BagError, match="it has more than 600 bytes"):
        read(tmp_path, "t,x\n" + rows(), "t", "x")


def test_a_blank_in_numbers_is_said(tmp_path: Path) -> None:
    """It stands between thousands, or between two numbers."""
    text = "t;x\n" + "".join(f"{n};{500 + n} 300\n" for n in range(20))
    found = read(tmp_path, text, "t", "x")
    assert found.samples.position[1] == 501300.0
    assert found.notes[0].endswith("semicolons as separators, 500 300 as 500300")


def test_what_is_left_out_is_counted_and_its_first_line_named(tmp_path: Path) -> None:
    text = "t;x\n\n0;1\n1;2\n\n4;5;6\n2;a\n3;1e160\n5;7\n6;8\n7;9\n8;9\n9;9\n10;9\n11;9\n"
    found = read(tmp_path, text, "t", "x")
    assert "column x has no number in 2 of 11 rows; the first is line 7" in found.notes[2]
    longer = "1 lines have more cells than the others and are left out, the first is line 6"
    assert longer in found.notes[1]


@pytest.mark.parametrize(
    ("text", "form", "position"),
    [
        ("a;b\n0;1.000\n1;2.000\n", TableFormat(decimal=","), [1000.0, 2000.0]),
        ('a,b\n0,"1,000"\n1,"2,000"\n', TableFormat(decimal="."), [1000.0, 2000.0]),
        ('a,b\n0,"1,000.5"\n1,"2"\n', TableFormat(), [1000.5, 2.0]),
        ("a;b\n0;1.000,5\n1;2,0\n", TableFormat(), [1000.5, 2.0]),
        ("a;b\n0;1'000.5\n1;2.0\n", TableFormat(), [1000.5, 2.0]),
        ("a;b\n0;1.000.500\n1;2.000\n", TableFormat(), [1000500.0, 2000.0]),
        ("a;b\n1;2\n0;1\n-1;0\n", TableFormat(), [0.0, 1.0, 2.0]),
        ("a;b\n0;1\xa0000,5\n1;2,0\n", TableFormat(), [1000.5, 2.0]),
        ("a;b\n0;1 000,5\n1;2,0\n", TableFormat(), [1000.5, 2.0]),
        ("0;0\n1;1\na;b\n0;5\n1;6\n", TableFormat(skip=2), [5.0, 6.0]),
        ("a;b\n0;5\n1;6\n".encode("cp037"), TableFormat(encoding="cp037"), [5.0, 6.0]),
    ],
)
def test_what_is_said_of_the_form_is_used(
    tmp_path: Path, text: str | bytes, form: TableFormat, position: list[float]
) -> None:
    assert read(tmp_path, text, "a", "b", form).samples.position.tolist() == position


def test_what_is_no_table_is_refused_with_a_way(tmp_path: Path) -> None:
    japanese = ("時間;位置\n" + rows(";")).encode("shift_jis")
    for name, content, way in (
        ("log.txt", b"only words\nand more\n", "encoding"),
        ("log.txt", b"1\n2\n3\n", "encoding"),
        ("log.txt", b"\0\1\2\3" * 100, "encoding"),
        ("log.txt", japanese, "--encoding shift_jis reads it"),
        ("log.xls", b"\xd0\xcf\x11\xe0\0\1", "save it as .xlsx"),
        ("log.wav", b"RIFF\0\1", "wavfile"),
        ("log.svdx", b"PK\3\4", "TwinCAT Scope"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(BagError, match=way):
            read_table(tmp_path / name, {"time": "t", "position": "x"})
    form = TableFormat(encoding="shift_jis")
    found = read(tmp_path, japanese, "時間", "位置", form).samples.position
    assert found.tolist() == POSITION.tolist()
    refusals: list[tuple[dict[str, Any], str]] = [
        ({"decimal": "x"}, "must be . or ,"),
        ({"skip": -1}, "must be at least 0"),
        ({"encoding": "nothing"}, "must be one of Python's"),
        ({"encoding": "hex"}, "must be one of Python's"),
    ]
    for options, sentence in refusals:
        with pytest.raises(InvalidInputError, match=sentence):
            TableFormat(**options)
