"""Deadlines of recorded messages."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.nodes.replaying.timeline import JITTER, Timeline

SECOND = 1_000_000_000
STAMPS = st.integers(0, 4_000_000_000 * SECOND)
RATES = st.floats(0.01, 1000.0)


def timeline_at(*log_times: int, rate: float = 1.0) -> Timeline:
    """Return a timeline that has gone through these log times and began at 100 s."""
    timeline = Timeline(rate)
    for number, log_time in enumerate(log_times):
        timeline.go_to(log_time, 100.0 + number)
    return timeline


@given(STAMPS, st.lists(st.integers(0, SECOND), min_size=1), RATES)
def test_no_deadline_depends_on_how_late_those_before_were(
    first: int, steps: list[int], rate: float
) -> None:
    timeline = Timeline(rate)
    timeline.go_to(first, 50.0)
    stamp = first
    for step in steps:
        stamp += step
        timeline.go_to(stamp, 1e6)
        assert timeline.deadline == pytest.approx(50.0 + (stamp - first) * 1e-9 / rate, rel=1e-12)


def test_nothing_waits_for_the_past() -> None:
    timeline = timeline_at(5 * SECOND, 7 * SECOND, 7 * SECOND - JITTER)
    assert timeline.deadline == 102.0
    timeline.go_to(8 * SECOND, 0.0)
    assert timeline.deadline == 103.0


def test_a_segment_of_earlier_stamps_follows_after_one_interval() -> None:
    timeline = timeline_at(500 * SECOND, 501 * SECOND, 504 * SECOND, 2 * SECOND, rate=2.0)
    assert timeline.deadline == 100.0 + (4.0 + 3.0) / 2.0
    timeline.go_to(4 * SECOND, 0.0)
    assert timeline.deadline == 100.0 + (4.0 + 3.0 + 2.0) / 2.0
    assert timeline.now == 4 * SECOND


def test_after_a_restart_the_first_message_follows_after_one_interval() -> None:
    step = SECOND // 100
    timeline = timeline_at(SECOND, SECOND + step, SECOND + 2 * step)
    for _ in range(3):
        timeline.start_segment()
        for number in range(3):
            timeline.go_to(SECOND + number * step, 0.0)
    assert timeline.deadline == pytest.approx(100.0 + 11 * 0.01, rel=1e-12)


def test_a_single_message_does_not_come_again_at_once() -> None:
    timeline = timeline_at(SECOND)
    timeline.start_segment()
    timeline.go_to(SECOND, 0.0)
    assert timeline.deadline == 101.0


def test_a_pause_moves_every_deadline() -> None:
    timeline = timeline_at(SECOND, 3 * SECOND)
    for now, act in ((101.0, Timeline.pause), (101.5, Timeline.pause), (104.0, Timeline.resume)):
        act(timeline, now)
    assert timeline.deadline == 105.0
    timeline.resume(110.0)
    assert timeline.deadline == 105.0
