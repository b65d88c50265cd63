"""Files of other tools, written by their libraries: what is read of them, and what is refused."""

import json
import re
import sys
from collections.abc import Callable
from io import BytesIO, TextIOWrapper
from pathlib import Path
from zipfile import ZIP_BZIP2, ZipFile

import h5py
import numpy as np
import pandas as pd
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from stickslip_ros.errors import BagError
from stickslip_ros.record import table_formats
from stickslip_ros.record.table_file import read_table, table_of

TIME = np.arange(5.0)


def checked(vectors: table_formats.Vectors) -> None:
    """Check what is found of the same variables in a file of either form."""
    found = {name: values for name, _, values in vectors}
    assert [*found] == ["t", "log.x", "log.deep.n", "data[1]", "data[2]"]
    for name, values in (("t", TIME), ("log.x", 2.0 * TIME), ("log.deep.n", [3.0])):
        assert found[name].tolist() == list(values)
    assert (found["data[1]"].tolist(), found["data[2]"].tolist()) == ([1.0] * 5, [4.0] * 5)


def test_fields_of_structures_and_columns_of_matrices_are_found() -> None:
    log = {"x": 2.0 * TIME, "deep": {"n": 3}, "name": "drive"}
    data = np.column_stack([np.full(5, 1.0), np.full(5, 4.0)])
    stream = BytesIO()
    savemat(stream, {"t": TIME[:, None], "log": log, "data": data, "cube": np.ones((2, 2, 2))})
    checked(table_formats._of_scipy(stream.getvalue()))


def test_files_of_version_7_3_have_the_same_vectors() -> None:
    """Groups are structures, and matrices are stored by columns."""
    stream = BytesIO()
    with h5py.File(stream, "w", track_order=True, userblock_size=512) as file:
        file["t"] = TIME[None, :]
        log = file.create_group("log", track_order=True)
        log["x"] = 2.0 * TIME
        log.create_group("deep")["n"] = [[3]]
        log["name"] = np.frombuffer(b"drive", "S1")
        file["data"] = np.array([[1.0] * 5, [4.0] * 5])
    checked(table_formats._of_hdf5(b"MATLAB 7.3 MAT-file".ljust(512) + stream.getvalue()[512:]))


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ({"units": "m", "slow": [[0, 1.5]], "fast": [[0, 1.5], [1, 2]]}, "0,1.5\n1,2.0\n"),
        ({"meta": {"b": [1, 2]}, "data": [{"t": each} for each in range(3)]}, "t\n0\n1\n2\n"),
        ({"log": {"name": "axis", "t": [0, 1], "x": [2, 3], "n": []}}, "t,x\n0,2\n1,3\n"),
    ],
)
def test_json_has_rows_or_vectors(content: object, text: str) -> None:
    assert table_formats._of_json(json.dumps(content).encode()) == text
    assert table_formats._of_json(b'{"t": 0, "x": 1}\n{"t": 1, "x": 2}\n') == "t,x\n0,1\n1,2\n"


def test_json_without_a_table_is_refused() -> None:
    for content in ({}, [], 7, {"a": [], "b": "c"}, [1.0, 2.0]):
        with pytest.raises(SystemExit, match="neither a list of rows nor vectors"):
            table_formats._of_json(json.dumps(content).encode())


def test_vectors_have_the_units_of_their_attributes() -> None:
    stream = BytesIO()
    with h5py.File(stream, "w") as file:
        for name, unit in {"x": "mm", "t": b"ms"}.items():
            file[name] = TIME
            file[name].attrs["unit"] = unit
        file["log"] = np.column_stack([TIME, 2.0 * TIME])  # rows as h5py and others write them
    read = list(table_formats._of_hdf5(stream.getvalue()))
    units = {name: unit for name, unit, _ in read}
    assert units == {"log[1]": "", "log[2]": "", "t": "ms", "x": "mm"}
    assert read[1][2].tolist() == (2.0 * TIME).tolist()
    array = BytesIO()
    np.save(array, np.column_stack([TIME, 2.0 * TIME]))
    found = {name: each.tolist() for name, _, each in table_formats._of_numpy(array.getvalue())}
    assert found == {"data[1]": TIME.tolist(), "data[2]": (2.0 * TIME).tolist()}


def _virtual(group: h5py.Group, other: Path) -> None:
    layout = h5py.VirtualLayout((8,), "u1")
    layout[:] = h5py.VirtualSource(str(other), "x", (8,))
    group.create_virtual_dataset("x", layout)


@pytest.mark.parametrize(
    "store",
    [
        lambda group, other: group.create_dataset("x", (8,), "u1", external=[(str(other), 0, 8)]),
        _virtual,
        lambda group, other: group.update(x=h5py.ExternalLink(str(other), "/x")),
        lambda group, _: group.update(x=h5py.SoftLink("/t")),
    ],
)
@pytest.mark.parametrize("place", ["/", "/log/deep"])
def test_nothing_is_read_from_another_file(
    store: Callable[[h5py.Group, Path], None], place: str, tmp_path: Path
) -> None:
    """Whoever writes a recording must not get the reader's other files into a report of it."""
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = np.arange(8, dtype="u1")
    stream = BytesIO()
    with h5py.File(stream, "w") as file:
        file["t"] = TIME
        store(file.require_group(place), tmp_path / "other.h5")
    with pytest.raises(SystemExit, match=r"x is (a link|stored in another file)"):
        list(table_formats._of_hdf5(stream.getvalue()))


RATE, FREQUENCY, AMPLITUDE = 500.0, 5.0, 2e-3
INSTANTS = np.arange(1000) / RATE
SWING = AMPLITUDE * np.sin(2.0 * np.pi * FREQUENCY * INSTANTS)


def _excel(path: Path) -> None:
    with pd.ExcelWriter(path, engine="openpyxl") as book:
        pd.DataFrame([["machine", "feed axis"]]).to_excel(book, sheet_name="about", header=False)
        table = pd.DataFrame({"t [ms]": INSTANTS * 1e3, "Weg [mm]": SWING * 1e3})
        table.to_excel(book, sheet_name="log", index=False)


def _parquet(path: Path) -> None:
    table = pd.DataFrame({"Weg [mm]": SWING * 1e3}, index=pd.Index(INSTANTS * 1e3, name="t [ms]"))
    table.to_parquet(path, engine="pyarrow")


def _numpy(path: Path) -> None:
    np.savez_compressed(path, t=INSTANTS[:, None], log=np.column_stack([SWING, INSTANTS]))


def _tdms(path: Path) -> None:
    timing = {"wf_increment": 1.0 / RATE, "wf_start_offset": 0.0, "unit_string": "mm"}
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("axis", "x", SWING * 1e3, timing)])


def _echo(path: Path) -> None:
    """Write what `ros2 topic echo` prints of joint states."""
    messages = [
        f"header:\n  stamp:\n    sec: {row // 500 + 7}\n    nanosec: {row % 500 * 2_000_000}\n"
        f"name:\n- table\n- screw\nposition:\n- {value!r}\n- 0.0\nvelocity: []\n---\n"
        for row, value in enumerate(SWING.tolist())
    ]
    path.write_text("".join(messages))


FORMATS = {
    "log.xlsx": (_excel, "t", "Weg"),
    "log.parquet": (_parquet, "t", "Weg"),
    "log.npz": (_numpy, "t", "log[1]"),
    "log.tdms": (_tdms, "x.time", "x"),
    "log.yaml": (_echo, "header.stamp", "position.table"),
}


@pytest.mark.process
@pytest.mark.parametrize("name", FORMATS)
def test_a_file_of_another_tool_is_measured(name: str, tmp_path: Path) -> None:
    write, time, position = FORMATS[name]
    write(tmp_path / name)
    recording = read_table(tmp_path / name, {"time": time, "position": position})
    assert recording.samples.position == pytest.approx(SWING, abs=1e-15)
    assert recording.samples.stamp.tolist() == [2_000_000 * row for row in range(len(SWING))]
    about = [note for note in recording.notes if "sheet" in note]
    assert about == (["of 2 sheets, log is read, the largest"] if name == "log.xlsx" else [])


@pytest.mark.process
@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_file_of_another_tool_is_refused_in_a_sentence(name: str, tmp_path: Path) -> None:
    write, _, _ = FORMATS[name]
    write(tmp_path / name)
    content = (tmp_path / name).read_bytes()
    damaged = b"- [" if name == "log.yaml" else content[:4] + content[len(content) // 2 :]
    (tmp_path / name).write_bytes(damaged)
    with pytest.raises(BagError) as refused:
        table_of(tmp_path / name)
    assert str(refused.value).startswith(f"{tmp_path / name}: the file cannot be read: it ")
    assert "\n" not in str(refused.value)


def _pickled(path: Path) -> None:
    np.savez(path, t=np.array([{"a": 1}], dtype=object))


def _bomb(path: Path) -> None:
    """Write an archive of a kilobyte whose array takes two gigabytes, as it says."""
    with ZipFile(path, "w", ZIP_BZIP2) as archive, archive.open("t.npy", "w") as stream:
        np.lib.format.write_array_header_1_0(
            stream, {"descr": "<f8", "fortran_order": False, "shape": (1 << 28,)}
        )
        stream.write(bytes(1 << 24))


def _aliases(path: Path) -> None:
    """Write a text whose aliases stand for a thousand million others."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 10)]
    path.write_text("\n".join(lines))


def _other_archive(path: Path) -> None:
    with ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "x")


@pytest.mark.process
@pytest.mark.parametrize(
    ("write", "name", "sentence"),
    [
        (_pickled, "log.npz", "it is damaged: ValueError"),
        (_bomb, "log.npz", "it takes more than 1073741824 bytes of memory"),
        (_aliases, "log.yaml", "it has a message of more than 1000 fields"),
        (_other_archive, "log.zip", "neither of Excel (.xlsx) nor of numpy (.npz)"),
    ],
)
def test_a_malicious_file_of_another_tool_is_refused(
    write: Callable[[Path], None], name: str, sentence: str, tmp_path: Path
) -> None:
    write(tmp_path / name)
    with pytest.raises(BagError, match=re.escape(sentence)):
        table_of(tmp_path / name)


def test_a_missing_library_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What reads the file is not installed."""
    monkeypatch.setitem(sys.modules, "nptdms", None)
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(b"TDSm")))
    monkeypatch.setattr("resource.setrlimit", lambda *_: None)
    monkeypatch.setattr("os._exit", sys.exit)
    with pytest.raises(SystemExit):
        table_formats._main("TDSm", 10)
    assert capsys.readouterr().err == "a TDMS file is read by npTDMS: install it\n"
