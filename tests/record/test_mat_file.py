"""The vectors of MAT files; tests/record/test_table_file.py reads whole files."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from stickslip_ros.record import mat_file

TIME = np.arange(5.0)


def checked(found: dict[str, Any]) -> None:
    """Check what is found of the same variables in a file of either form."""
    assert [*found] == ["t", "log.x", "log.deep.n", "data[1]", "data[2]"]
    for name, values in (("t", TIME), ("log.x", 2.0 * TIME), ("log.deep.n", [3.0])):
        assert found[name].tolist() == list(values)
    assert (found["data[1]"].tolist(), found["data[2]"].tolist()) == ([1.0] * 5, [4.0] * 5)


def test_fields_of_structures_and_columns_of_matrices_are_found() -> None:
    log = {"x": 2.0 * TIME, "deep": {"n": 3}, "name": "drive"}
    data = np.column_stack([np.full(5, 1.0), np.full(5, 4.0)])
    stream = BytesIO()
    savemat(stream, {"t": TIME[:, None], "log": log, "data": data, "cube": np.ones((2, 2, 2))})
    checked(dict(mat_file._of_scipy(stream.getvalue())))


def test_files_of_version_7_3_have_the_same_vectors() -> None:
    """Groups are structures, and matrices are stored by columns."""
    stream = BytesIO()
    with h5py.File(stream, "w", track_order=True) as file:
        file["t"] = TIME[None, :]
        log = file.create_group("log", track_order=True)
        log["x"] = 2.0 * TIME
        log.create_group("deep")["n"] = [[3]]
        log["name"] = np.frombuffer(b"drive", "S1")
        file["data"] = np.array([[1.0] * 5, [4.0] * 5])
    checked(dict(mat_file._of_hdf5(stream.getvalue())))


def _external(group: h5py.Group, other: Path) -> None:
    group.create_dataset("x", (8,), "u1", external=[(str(other), 0, 8)])


def _virtual(group: h5py.Group, other: Path) -> None:
    layout = h5py.VirtualLayout((8,), "u1")
    layout[:] = h5py.VirtualSource(str(other), "x", (8,))
    group.create_virtual_dataset("x", layout)


def _external_link(group: h5py.Group, other: Path) -> None:
    group["x"] = h5py.ExternalLink(str(other), "/x")


def _soft_link(group: h5py.Group, other: Path) -> None:
    group["x"] = h5py.SoftLink("/t")


@pytest.mark.parametrize("store", [_external, _virtual, _external_link, _soft_link])
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
        dict(mat_file._of_hdf5(stream.getvalue()))
