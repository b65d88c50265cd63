from itertools import pairwise

import numpy as np
import pytest

from stickslip_ros.arrays import median, rms, windows
from stickslip_ros.samples import ForceColumns


def forces(*stamps: int) -> ForceColumns:
    return ForceColumns(np.array(stamps, np.int64), np.array(stamps, float) / 2.0)


def told(table: ForceColumns) -> list[tuple[int, float]]:
    return list(zip(table.stamp.tolist(), table.force.tolist(), strict=True))


def test_a_table_has_rows() -> None:
    table = forces(3, 5, 7)
    assert len(table) == 3
    assert told(table[1:]) == [(5, 2.5), (7, 3.5)]
    assert told(table[np.array([2, 0])]) == [(7, 3.5), (3, 1.5)]
    assert told(table[table.force > 2.0]) == told(table[1:])
    assert len(table[:0]) == 0


def test_tables_follow_each_other() -> None:
    assert told(forces(1).followed_by(forces(), forces(2, 3))) == told(forces(1, 2, 3))
    assert told(forces(1).followed_by()) == [(1, 0.5)]


@pytest.mark.parametrize("rows", [0, 2, 3, 1000, 200_000])
@pytest.mark.parametrize("overlap", [0, 1, 2])
def test_windows_have_every_row_and_share_the_overlap(rows: int, overlap: int) -> None:
    found = [np.arange(rows)[part] for part in windows(rows, overlap)]
    own = [*found[:1], *(part[overlap:] for part in found[1:])]
    assert np.concatenate([[], *own]).tolist() == list(range(rows if rows > overlap else 0))
    assert (len(found) > 1) == (rows > 100_000)
    for before, part in pairwise(found):
        assert before[len(before) - overlap :].tolist() == part[:overlap].tolist()


def test_the_root_mean_square() -> None:
    assert rms(np.array([1.0, -7.0])) == 5.0


@pytest.mark.parametrize("values", [[3.0], [1.0, 4.0], [5.0, -1.0, 2.0], [0.1, 0.7, 0.2, 0.4]])
def test_the_median_is_that_of_numpy(values: list[float]) -> None:
    assert median(np.array(values)) == np.median(values)
    assert np.isnan(median(np.array([*values, np.nan])))
