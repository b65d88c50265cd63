"""Records from bags and tables."""

from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification import reading
from stickslip_ros.identification.reading import read_all, read_records

_COLUMNS = {"time": "t", "position": "x", "force": "u", "disturbance": "d"}


@pytest.fixture
def tables(tmp_path: Path) -> list[Path]:
    """Two tables, of which the second one has a disturbance."""
    time = 1e-3 * np.arange(700)
    rows = np.column_stack([time, np.sin(time), np.cos(time), np.ones(700)])
    paths = [tmp_path / "one.csv", tmp_path / "two.csv"]
    np.savetxt(paths[0], rows[:, :3], delimiter=",", header="t,x,u", comments="")
    np.savetxt(paths[1], rows, delimiter=",", header="t,x,u,d", comments="")
    return paths


def test_each_table_is_read_once(tables: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Path] = []
    own = reading.table_of

    def counted(path: Path) -> dict[str, FloatArray]:
        asked.append(path)
        return own(path)

    monkeypatch.setattr(reading, "table_of", counted)
    found = read_all(tables, _COLUMNS)
    assert asked == tables
    one, two = (found[path].records[0] for path in tables)
    assert one.disturbance is None
    assert two.disturbance is not None


def test_the_belt_speed_of_a_table(tables: list[Path]) -> None:
    columns = {"time": "t", "position": "x"}
    (plain,) = read_records(tables[0], columns).records
    assert not plain.belt_velocity.any()
    (moved,) = read_records(tables[0], columns, belt_speed=0.04).records
    assert set(moved.belt_velocity) == {0.04}


def test_a_part_that_is_not_there_is_refused(tables: list[Path]) -> None:
    columns = {"time": "t", "position": "x"}
    with pytest.raises(InvalidInputError, match=r"no samples from 5 s on: it lasts 0\.699 s"):
        read_records(tables[0], columns, start=5.0)
    with pytest.raises(InvalidInputError, match="no samples from 5 s to 6 s: it lasts"):
        read_records(tables[0], columns, start=5.0, end=6.0)


@pytest.mark.parametrize("cell", ["1e160", "-1e308", "inf", "1e-320"])
def test_a_wild_cell_is_not_used(tables: list[Path], cell: str) -> None:
    rows = tables[1].read_text().splitlines()
    rows[300] = f"0.299,{cell},{cell},{cell}"
    tables[1].write_text("\n".join(rows))
    (record,) = read_records(tables[1], _COLUMNS).records
    assert len(record.position) == 700
    for values in (record.position, record.force, record.disturbance):
        assert values is not None
        assert np.abs(values).max() < 1.1
