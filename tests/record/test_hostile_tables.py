"""Tables that are damaged or malicious: read within limits, or refused in one sentence."""

import os
import random
import struct
import zlib
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.io import savemat

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.measures.slips import SlipThreshold
from stickslip_ros.record.compression import unpack_file
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.table_file import read_table, table_of
from tests.examples import examples

COLUMNS = {"time": "t", "position": "x", "force": "u"}
TIME = np.arange(300) * 1e-3
SOUND = {"t": TIME, "x": 1e-4 * np.sin(60.0 * TIME), "u": np.cos(60.0 * TIME)}
HEADING = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
CELLS, DOUBLES = 1, 6
ODD_CELLS = ("1e160", "-1e308", "1e-320", "-0", "inf", "nan", "", "x", "\0", '"1"', "1,2",
             "9" * 400)  # fmt: skip
ODD_WORDS = (0, 1, 7, 9, 14, 15, 20, 2**31 - 1, 2**31, 2**32 - 1)


def element(kind: int, data: bytes, size: int | None = None) -> bytes:
    head = struct.pack("<II", kind, len(data) if size is None else size)
    return head + data + bytes(-len(data) % 8)


def variable(rows: int, data: bytes, kind: int = DOUBLES, inner: int | None = None) -> bytes:
    """Return a variable `t`; it says that what it holds is larger by `inner`."""
    head = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack("<2i", rows, 1))
    content = head + element(1, b"t") + data
    return element(14, content, None if inner is None else len(content) + inner)


def packed(content: bytes) -> bytes:
    data = zlib.compress(content, 1)
    return struct.pack("<II", 15, len(data)) + data


def cells_in_cells() -> bytes:
    parts, size = list[bytes](), 0
    for _ in range(20_000):
        parts.append(variable(1, b"", CELLS, inner=size))
        size += len(parts[-1])
    return b"".join(reversed(parts))


MALICIOUS = {
    "cells in cells": HEADING + cells_in_cells(),
    "packed cells in cells": HEADING + packed(cells_in_cells()),
    "few numbers, many bytes": HEADING + packed(variable(1, element(9, bytes(4 << 20)))),
    "more numbers than bytes": HEADING + variable(2**31 - 1, element(9, bytes(80))),
    "version 7.3, no more": b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(400),
    "version 4, much": struct.pack("<5i", 0, 2**31 - 1, 2**31 - 1, 0, 2) + b"t\0" + bytes(100),
}


@pytest.mark.process
@pytest.mark.parametrize(
    "name",
    [*[*MALICIOUS][:3], *(pytest.param(n, marks=pytest.mark.long) for n in [*MALICIOUS][3:])],
)
def test_a_malicious_mat_file_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "log.mat"
    path.write_bytes(MALICIOUS[name])
    with pytest.raises(BagError) as refused:
        table_of(path)
    assert str(refused.value).startswith(f"{path}: the file cannot be read: it ")
    assert len(str(refused.value).splitlines()) == 1


def test_a_file_beyond_a_limit_is_refused_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip_ros.record.text_table._MOST_NUMBERS", 1000)
    path = tmp_path / "log.csv"
    for content, sentence in (
        (",".join(map(str, range(20_000))) + "\n1\n", "more than 10000 columns"),
        ("t,x\n1,2,3\n1,2,3\n", "line 1 has 2 names for 3 columns; with --skip 1"),
        ("t,x\n" + "1,2\n" * 600, "more than 1000 numbers"),
        ("t,x\n" + "1,-\n1,2\n" * 300, "more than 1000 numbers"),
        ("\n\n", "it is empty"),
    ):
        path.write_text(content, encoding="utf-8")
        with pytest.raises(BagError, match=sentence) as refused:
            read_table(path, {"time": "t", "position": "x"})
        assert len(str(refused.value)) < 300 + len(str(path))
    path.write_text(f"t,{'x' * 50_000}\n1,2\n", encoding="utf-8")
    for columns in (None, {"time": "t", "position": "y"}):
        with pytest.raises(InvalidInputError) as refused_columns:
            read_table(path, columns)
        assert len(str(refused_columns.value)) < 2000
    (tmp_path / "large.csv").touch()
    os.truncate(tmp_path / "large.csv", 1 << 30)
    with pytest.raises(BagError, match="it is no text"):
        table_of(tmp_path / "large.csv")


@pytest.mark.timeout(120)
def test_only_regular_files_are_read(tmp_path: Path) -> None:
    for suffix in (".csv", ".mat"):
        os.mkfifo(tmp_path / f"pipe{suffix}")
        (tmp_path / f"endless{suffix}").symlink_to("/dev/zero")
        for name in ("pipe", "endless"):
            with pytest.raises(BagError, match="not a regular file"):
                table_of(tmp_path / f"{name}{suffix}")
    with pytest.raises(OSError, match="not a regular file"):
        unpack_file(tmp_path / "pipe.csv", tmp_path / "out")


def test_a_cell_that_no_measure_bears_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for cell in ("1e160", "-1e308", "inf", "nan"):
        path.write_text(f"t,x,u\n0,1,1\n0.1,{cell},{cell}\n0.2,1e-320,1\n", encoding="utf-8")
        recording = read_table(path, COLUMNS)
        assert "column x has no number in 1 of 3 rows" in recording.notes[0]
        assert np.array_equal(recording.samples.position, [1.0, np.nan, 0.0], equal_nan=True)
        assert np.array_equal(recording.forces.force, [1.0, np.nan, 1.0], equal_nan=True)


def changed(kind: str, chance: random.Random) -> bytes:
    """Return a table, a little changed."""
    if kind == "csv":
        rows = [[repr(float(value)) for value in row] for row in zip(*SOUND.values(), strict=True)]
        for _ in range(chance.choice([1, 3, 300])):
            chance.choice(rows)[chance.randrange(3)] = chance.choice(ODD_CELLS)
        rows = rows[: chance.choice([0, 1, 2, 12, 300])]
        separator = chance.choice([",", ",", ";", "\t", " ", "|"])
        text = "\n".join(map(separator.join, [["t", "x", "u"], *rows]))
        if separator != "," and chance.random() < 0.5:
            text = text.replace(".", ",")
        top = chance.choice(["", "", "a;b\n\n", "s,mm,N\n", '"\n', "1;2\n\n"])
        content = bytearray((top + text).encode(chance.choice(["utf-8", "utf-8", "utf-16"])))
    else:
        stream, version = BytesIO(), chance.choice("455")
        options: dict[str, Any] = (
            {} if version == "4" else {"do_compression": chance.random() < 0.5}
        )
        savemat(stream, {**SOUND, "name": "a"}, format=version, **options)
        content = bytearray(stream.getvalue())
    for _ in range(chance.choice([0, 1, 5])):
        place = chance.randrange(len(content) - 4)
        match chance.choice(["byte", "word", "word", "cut"]):
            case "byte":
                content[place] = chance.randrange(256)
            case "word":
                place = place // 4 * 4
                content[place : place + 4] = struct.pack("<I", chance.choice(ODD_WORDS))
            case _:
                del content[max(place, 8) :]
    return bytes(content)


@examples(quick=40, thorough=150, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_csv_file_that_was_changed_is_measured_or_refused(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    measure_or_refuse(tmp_path_factory, "csv", seed)


@pytest.mark.process
@examples(quick=3, thorough=10, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_mat_file_that_was_changed_is_measured_or_refused(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    measure_or_refuse(tmp_path_factory, "mat", seed)


def measure_or_refuse(tmp_path_factory: pytest.TempPathFactory, kind: str, seed: int) -> None:
    path = tmp_path_factory.getbasetemp() / f"changed.{kind}"
    path.write_bytes(changed(kind, random.Random(seed)))
    with suppress(InvalidInputError):
        report = report_of_recording(path, COLUMNS, slips=SlipThreshold(1e-5, within=1e7))
        assert report["samples"] <= len(TIME)


@pytest.mark.process  # of bytes that begin like a MAT file
@examples(quick=40, thorough=150, deadline=None)
@given(content=st.binary(max_size=300) | st.text(alphabet="0159.,;:-T\t\n\"' xe#/µ", max_size=300))
def test_any_bytes_are_measured_or_refused(
    tmp_path_factory: pytest.TempPathFactory, content: bytes | str
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.txt"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with suppress(InvalidInputError):
        report_of_recording(path, {"time": "#1", "position": "#2"})


def faulty(chance: random.Random) -> tuple[bytes, dict[str, str]]:
    """Return a table of a machine with faults of its sensors, and columns."""
    rng = np.random.default_rng(chance.randrange(2**32))
    count, rate = chance.choice([1, 2, 9, 40, 700]), chance.choice([7.0, 50.0, 1000.0])
    time = np.arange(count) / rate
    motions = [time, np.floor(3.0 * time), np.sin(9.0 * time), np.zeros(count), time % 0.3]
    position = sum(chance.uniform(-1.0, 1.0) * each for each in chance.sample(motions, 2))
    velocity = np.gradient(position, time) if count > 1 else time
    velocity = chance.choice([velocity, 1e3 * velocity, np.roll(velocity, 20), 0.0 * velocity])
    for each in (position, velocity):
        for _ in range(chance.choice([0, 0, 1, 5])):
            start = chance.randrange(count)
            each[start : start + chance.randrange(1, 30)] = chance.choice([0.0, 5.0, 1e99, np.nan])
    if chance.random() < 0.3:
        position = np.mod(position, chance.choice([0.1, 1.0, 2.0**8]))
    position += chance.choice([0.0, 0.0, 1e-3]) * rng.standard_normal(count)
    if chance.random() < 0.3:
        position = np.round(position, chance.randrange(4))
    if chance.random() < 0.3:
        time = np.round(time, chance.randrange(4))
    scale = chance.choice([1.0, 1.0, 1e-150, 1e90])
    table = np.column_stack([time, scale * position, velocity, rng.standard_normal(count)])
    lines = ["t,x,v,u", *(",".join(map(repr, row)) for row in table.tolist())]
    optional = {
        "velocity": chance.choice(["v", "v*1e-3", "x-v"]),
        "force": "u",
        "belt_velocity": chance.choice(["0", "0.1", "v"]),
    }
    asked = chance.sample([*optional], chance.randrange(4))
    columns = {"time": "t", "position": chance.choice(["x", "unwrap(x, 1)", "1e3*x - u"])}
    return "\n".join(lines).encode(), columns | {name: optional[name] for name in asked}


@examples(quick=20, thorough=150, deadline=None)
@given(seed=st.integers(0, 2**32))
@example(seed=4900)  # times that repeat, between rests
def test_a_table_with_faults_is_measured_or_refused(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "faulty.csv"
    content, columns = faulty(random.Random(seed))
    path.write_bytes(content)
    with suppress(InvalidInputError):
        report = report_of_recording(path, columns, slips=SlipThreshold(1e-2))
        assert report["samples"] <= 700
