"""Deadlines of recorded messages, and the thread that keeps them."""

import time
from collections.abc import Callable, Iterator
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.errors import BagError, RunError
from stickslip_ros.nodes.pacing import FlowWindow
from stickslip_ros.nodes.replaying.player import JITTER, Message, Player, Timeline
from stickslip_ros.record.codec import pack_header
from tests.nodes.graph import PATIENCE, wait_for

SECOND = 1_000_000_000


class Performance:
    """A player and what it has sent."""

    def __init__(
        self,
        messages: Callable[[], Iterator[Message]],
        *,
        rate: float = 1000.0,
        loop: bool = False,
        windows: dict[str, FlowWindow] | None = None,
    ) -> None:
        self.sent: list[Message] = []
        self.times: list[float] = []
        self.ended = Event()
        self.player = Player(
            messages,
            self.send,
            lambda: True,
            self.ended.set,
            rate=rate,
            loop=loop,
            windows=windows or {},
        )

    def send(self, message: Message, recorded_time: int) -> None:
        self.recorded_time = recorded_time
        self.times.append(time.monotonic())
        self.sent.append(message)

    def to_the_end(self) -> None:
        self.player.start()
        assert self.ended.wait(PATIENCE)
        self.player.stop()


def states(count: int, step: int = SECOND // 100) -> Callable[[], Iterator[Message]]:
    """Return what gives messages on one topic, of which the payload has the stamp, too."""
    stamps = [SECOND + number * step for number in range(count)]
    return lambda: (("/joint_states", stamp, pack_header(stamp)) for stamp in stamps)


def test_messages_are_sent_in_turn_and_never_before_their_time() -> None:
    messages = states(50)
    performance = Performance(messages, rate=10.0)
    started = time.monotonic()
    performance.to_the_end()
    assert performance.sent == list(messages())
    assert performance.player.sent == 50
    assert performance.recorded_time == SECOND + 49 * SECOND // 100
    for number, moment in enumerate(performance.times):
        assert moment - started > number * 0.001 - 1e-9


def test_a_loop_goes_on_until_it_is_stopped() -> None:
    messages = states(5)
    performance = Performance(messages, loop=True)
    performance.player.start()
    wait_for(lambda: len(performance.sent) > 12, "the third pass")
    performance.player.stop()
    assert performance.sent[:12] == 2 * list(messages()) + list(messages())[:2]
    assert not performance.ended.is_set()


def test_paused_it_sends_nothing_and_stops_all_the_same() -> None:
    performance = Performance(states(20))
    performance.player.pause()
    performance.player.start()
    performance.player.resume()
    assert performance.ended.wait(PATIENCE)
    assert len(performance.sent) == 20
    performance.player.stop()

    paused = Performance(states(20))
    paused.player.pause()
    paused.player.start()
    paused.player.stop()
    assert paused.player.paused
    assert paused.sent == []


def test_it_stops_while_it_waits_for_what_is_due_in_years() -> None:
    performance = Performance(states(2, step=SECOND), rate=1e-12)
    performance.player.start()
    wait_for(lambda: len(performance.sent) == 1, "the first message")
    performance.player.stop()
    assert not performance.ended.is_set()


@pytest.mark.parametrize(
    ("error", "kept"), [(BagError("gone"), BagError), (ZeroDivisionError("odd"), RunError)]
)
def test_the_error_that_stops_the_player_is_kept(error: Exception, kept: type[Exception]) -> None:
    def broken() -> Iterator[Message]:
        yield from states(3)()
        raise error

    performance = Performance(broken)
    performance.to_the_end()
    assert len(performance.sent) == 3
    assert isinstance(performance.player.failure, kept)
    assert str(error) in str(performance.player.failure)


def test_a_stamp_that_comes_again_in_a_loop_does_not_fill_the_window() -> None:
    window = FlowWindow(200, lambda: True)
    for _ in range(50):
        for stamp in range(5):
            window.sent(stamp)
        window.recorded(3)
    assert window.under_way == 1


def test_it_goes_no_further_ahead_of_a_recorder_than_the_window() -> None:
    present = [True]
    window = FlowWindow(200, lambda: present[0])
    performance = Performance(states(1000), windows={"/joint_states": window})
    performance.player.start()
    wait_for(lambda: window.full, "the window is used up")
    assert len(performance.sent) == 200
    performance.player.recorder_came_to("/joint_states", SECOND + 99 * SECOND // 100)
    wait_for(lambda: window.full, "the window moves on by 100")
    assert len(performance.sent) == 300
    present[0] = False
    assert performance.ended.wait(PATIENCE)
    assert len(performance.sent) == 1000
    assert "recorder" in performance.player.complaint
    performance.player.stop()


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
    single = timeline_at(SECOND)
    single.start_segment()
    single.go_to(SECOND, 0.0)
    assert single.deadline == 101.0


def test_a_pause_moves_every_deadline() -> None:
    timeline = timeline_at(SECOND, 3 * SECOND)
    for now, act in ((101.0, Timeline.pause), (101.5, Timeline.pause), (104.0, Timeline.resume)):
        act(timeline, now)
    assert timeline.deadline == 105.0
    timeline.resume(110.0)
    assert timeline.deadline == 105.0
