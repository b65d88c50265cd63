"""Histories and latest parts of motions in few points, with every peak, in bounded memory."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.show.live_trace import LiveTrace
from stickslip_ros.show.run_history import Trace, peaks

NO_FORCES = ForceColumns(np.empty(0, dtype=np.int64), np.empty(0))
SECOND = 1_000_000_000


def states(stamps: range, position: np.ndarray) -> SampleColumns:
    stamp = np.asarray(stamps, dtype=np.int64)
    ones = np.ones(len(stamp))
    return SampleColumns(stamp, position, 2.0 * position, ones, ones, 0.5 * ones)


def forces(stamps: range, force: np.ndarray) -> ForceColumns:
    return ForceColumns(np.asarray(stamps, dtype=np.int64), force)


def test_before_the_first_sample_there_is_nothing_to_show() -> None:
    trace = LiveTrace(1.0)
    assert trace.frame(1.0, 1.0, 10) is None
    trace.feed(states(range(0), np.empty(0)), forces(range(3), np.ones(3)))
    assert trace.frame(1.0, 1.0, 10) is None


@given(st.lists(st.integers(1, 400), min_size=1, max_size=30), st.integers(2, 50), st.data())
def test_whatever_the_blocks_and_the_buckets_peaks_and_ends_are_shown(
    blocks: list[int], buckets: int, data: st.DataObject
) -> None:
    count = sum(blocks)
    position = np.asarray(
        data.draw(st.lists(st.floats(-1e6, 1e6), min_size=count, max_size=count))
        if count < 50
        else np.random.default_rng(count).normal(size=count)
    )
    trace = LiveTrace(1e9)
    edges = np.cumsum([0, *blocks])
    for begin, end in pairwise(edges):
        stamps = range(begin * 1_000_000, end * 1_000_000, 1_000_000)
        trace.feed(states(stamps, position[begin:end]), forces(stamps, -position[begin:end]))
    frame = trace.frame(1e6, 1e6, buckets)
    assert frame.end == pytest.approx((count - 1) * 1e-3)
    assert (np.diff(frame.position.x) > 0).all()
    assert frame.position.x[-1] == 0.0
    assert frame.position.x[0] == pytest.approx(-(count - 1) * 1e-3)
    for line, column in (
        (frame.position, position),
        (frame.velocity, 2.0 * position),
        (frame.force, -position),
        (frame.orbit, 2.0 * position),
    ):
        assert line.y.min() == column.min()
        assert line.y.max() == column.max()
        assert line.y[-1] == column[-1]
        assert set(line.y) <= set(column)
    assert len(frame.position.x) <= 4 * (buckets + 1)


def test_stamps_that_do_not_continue_restart_the_trace() -> None:
    trace = LiveTrace(1e3)
    trace.feed(states(range(10 * SECOND, 11 * SECOND, 1_000_000), np.ones(1000)), NO_FORCES)
    trace.feed(states(range(SECOND, SECOND + 10_000_000, 1_000_000), np.zeros(10)), NO_FORCES)
    frame = trace.frame(1e3, 1e3, 100)
    assert frame.end == pytest.approx(0.009)
    assert frame.position.y.max() == 0.0
    # So do stamps that descend within a block.
    block = states(range(SECOND, 2 * SECOND, 1_000_000), np.ones(1000))
    block.stamp[500:] -= SECOND
    trace.feed(block, NO_FORCES)
    frame = trace.frame(1e3, 1e3, 100)
    assert frame.end == pytest.approx(0.499)
    assert frame.position.x[0] == pytest.approx(-0.499)


def test_forces_for_the_past_are_left_out() -> None:
    trace = LiveTrace(1e3)
    trace.feed(
        states(range(0, SECOND, 1_000_000), np.ones(1000)),
        forces(range(0, SECOND, 1_000_000), np.ones(1000)),
    )
    trace.feed(states(range(0), np.empty(0)), forces(range(0, SECOND, 2_000_000), np.zeros(500)))
    frame = trace.frame(1e3, 1e3, 100)
    assert (np.diff(frame.force.x) > 0).all()
    assert frame.force.y.min() == 1.0


def test_a_line_is_broken_where_samples_are_missing() -> None:
    trace = LiveTrace(1e3)
    for begin in (1, 3):
        stamps = range(begin * SECOND, (begin + 1) * SECOND, 1_000_000)
        trace.feed(states(stamps, np.ones(1000)), forces(stamps, np.ones(1000)))
    frame = trace.frame(1e3, 1e3, 100_000)
    for line in (frame.position, frame.force):
        (gap,) = np.flatnonzero(np.isnan(line.y))
        assert line.x[gap - 1] == pytest.approx(-2.0)
        assert line.x[gap] == line.x[gap + 1] == pytest.approx(-0.999)


def test_a_force_for_the_far_future_does_not_hide_the_others() -> None:
    trace = LiveTrace(1e3)
    trace.feed(
        states(range(SECOND, 2 * SECOND, 1_000_000), np.ones(1000)),
        forces(range(10**17, 10**17 + 1), np.ones(1)),
    )
    trace.feed(states(range(0), np.empty(0)), forces(range(SECOND, SECOND + 5), np.ones(5)))
    frame = trace.frame(1e3, 1e3, 100)
    assert len(frame.force.x) > 0
    assert frame.force.x.max() < 0.0


@pytest.mark.parametrize("told_first", [False, True])
def test_forces_that_did_not_act_make_a_line_of_their_own(told_first: bool) -> None:
    trace = LiveTrace(10.0)
    stamps = range(0, SECOND, 10_000_000)
    sent = forces(stamps, np.arange(100.0))
    dropped = forces(stamps[40:60], np.arange(40.0, 60.0))
    trace.feed(states(stamps, np.zeros(100)), NO_FORCES, dropped if told_first else NO_FORCES)
    trace.feed(states(range(0), np.empty(0)), sent, NO_FORCES if told_first else dropped)
    frame = trace.frame(10.0, 1.0, 1000)
    assert frame.dropped.y.tolist() == list(range(40, 60))
    y = frame.force.y
    assert y[~np.isnan(y)].tolist() == [*range(40), *range(60, 100)]
    # One NaN would say that none came, and that the last one was held.
    assert np.flatnonzero(np.isnan(y)).tolist() == [40, 41]


FloatArray = npt.NDArray[np.float64]


def test_of_each_bucket_ends_and_extremes_are_kept_and_nan_is_none() -> None:
    bucket, column = np.repeat([0, 1], [6, 4]), [1.0, np.nan, 3.0, 0.0, 3.0, 2.0, *[np.nan] * 4]
    assert peaks(bucket, np.array(column)).tolist() == [0, 2, 3, 5, 6, 9]


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
    trace._LAST_ROWS = 3_000
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
