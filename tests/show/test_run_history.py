"""The history of a run: decimation without loss of peaks."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stickslip_ros.show.run_history import Trace, peaks

FloatArray = npt.NDArray[np.float64]

COLUMN = st.integers(0, 60).flatmap(
    lambda length: st.tuples(
        arrays(np.int64, length, elements=st.integers(-3, 8)).map(np.sort),
        arrays(np.float64, length, elements=st.floats(-9.0, 9.0) | st.just(np.nan)),
        arrays(np.float64, length, elements=st.integers(-2, 2).map(float)),
    )
)


def naively(bucket: npt.NDArray[np.int64], *columns: FloatArray) -> list[int]:
    """Look at one bucket after the other; of equal extremes take the first."""
    kept: set[int] = set()
    for number in set(bucket.tolist()):
        rows = [row for row in range(len(bucket)) if bucket[row] == number]
        kept |= {rows[0], rows[-1]}
        for column in columns:
            known = [row for row in rows if not np.isnan(column[row])]
            if known:
                kept |= {min(known, key=lambda row: column[row])}
                kept |= {max(known, key=lambda row: column[row])}
    return sorted(kept)


@given(COLUMN)
def test_it_keeps_what_a_plain_loop_would(
    found: tuple[npt.NDArray[np.int64], FloatArray, FloatArray],
) -> None:
    assert peaks(*found).tolist() == naively(*found)


def noise(length: int) -> list[FloatArray]:
    random = np.random.default_rng(1)
    return [np.arange(length) * 1e-3, random.normal(size=length), random.normal(size=length)]


@pytest.mark.parametrize("block", [999, 70_000])
def test_a_trace_of_any_length_is_short_and_has_every_peak(block: int) -> None:
    time, *columns = noise(1_000_000)
    trace = Trace(2)
    for start in range(0, len(time), block):
        rows = slice(start, start + block)
        trace.add(time[rows], *(column[rows] for column in columns))
    found, *kept = trace.columns()
    assert len(found) < 300_000
    assert np.all(np.diff(found) > 0.0)
    assert (found[0], found[-1]) == (time[0], time[-1])
    rows = np.searchsorted(time, found)
    for column, of_it in zip(columns, kept, strict=True):
        assert np.array_equal(of_it, column[rows])
    # Each of 1000 pixels has its peaks, at most a tenth of a pixel away.
    for pixel in range(1000):
        all_rows = slice(*np.searchsorted(time, (pixel, pixel + 1.0)))
        few = slice(*np.searchsorted(found, (pixel - 0.1, pixel + 1.1)))
        for column, of_it in zip(columns, kept, strict=True):
            assert of_it[few].min() <= column[all_rows].min()
            assert of_it[few].max() >= column[all_rows].max()


def test_the_end_of_a_trace_is_not_thinned() -> None:
    time, *columns = noise(450_000)
    trace = Trace(2)
    for start in range(0, len(time), 3000):
        trace.add(*(column[start : start + 3000] for column in (time, *columns)))
    for found, whole in zip(trace.since(time[-40_000]), (time, *columns), strict=True):
        assert np.array_equal(found, whole[-40_000:])
    assert 50_000 <= len(trace.since(0.0)[0]) <= 100_000


def test_what_is_old_is_forgotten_and_nothing_else() -> None:
    time, *columns = noise(30_000)
    trace = Trace(2)
    for start in range(0, len(time), 1000):
        trace.add(*(column[start : start + 1000] for column in (time, *columns)))
        trace.forget(time[start] - 5.0)
        found = trace.columns()
        assert len(found[0]) <= 2 * 6000 + 1
        kept = slice(max(start - 5000, 0), start + 1000)
        for whole, of_it in zip((time, *columns), found, strict=True):
            assert np.array_equal(of_it[-len(whole[kept]) :], whole[kept])


def test_rows_of_one_instant_are_thinned_too() -> None:
    trace = Trace(1)
    for _ in range(3):
        trace.add(np.ones(150_000), np.arange(150_000.0))
    time, values = trace.columns()
    assert len(time) <= 200_000
    assert (values.min(), values.max()) == (0.0, 149_999.0)
