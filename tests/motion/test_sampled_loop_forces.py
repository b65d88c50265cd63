"""Which forces a loop accepts, when they act, and which one acts if none has arrived."""

from collections.abc import Callable, Collection
from itertools import pairwise
from math import inf, isfinite, nan
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stickslip_ros.motion import Motion
from stickslip_ros.motion.force_answers import Verdict
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from tests.drives import PAPER

SECOND = 10**9
PERIOD = SECOND // 100
MOTION = Motion(PAPER, 0.0, 0.0)
paces = pytest.mark.parametrize("realtime", [False, True], ids=["lockstep", "realtime"])


class Loop(SampledLoop):
    """At 100 Hz from 1 s on; `acting` is the force under which it advanced last."""

    def __init__(self, realtime: bool = False, **options: Any) -> None:
        self.motion = Motion(PAPER, 0.0, 0.0)
        super().__init__(self.motion, 100.0, SECOND, hold_late=realtime, **options)

    @property
    def acting(self) -> float:
        return self.motion.force

    def answer(self, number: int, force: float) -> Verdict:
        return self.offer(SECOND + number * PERIOD, force)

    def advance_by(self, samples: int) -> None:
        for _ in range(samples):
            self.advance()


@paces
def test_a_force_acts_from_its_sample_to_the_next(realtime: bool) -> None:
    loop, hand = Loop(realtime), Motion(PAPER, 0.0, 0.0)
    for number, force in enumerate([0.5, -2.0, 0.0, 1.25]):
        assert not loop.answered
        assert loop.answer(number, force) is Verdict.ACCEPTED
        assert loop.answered
        hand.force = force
        hand.advance(0.01)
        sample = loop.advance()
        assert (sample.position, sample.velocity) == (hand.position, hand.velocity)
    assert loop.answers.late_forces == 0
    assert not loop.answers.dropped


@paces
@pytest.mark.parametrize(
    ("stamp", "force", "verdict"),
    [
        (SECOND + 5 * PERIOD, nan, Verdict.NOT_FINITE),
        (SECOND + 5 * PERIOD, inf, Verdict.NOT_FINITE),
        (SECOND + 5 * PERIOD, -inf, Verdict.NOT_FINITE),
        (0, 1.0, Verdict.NO_STAMP),
        (SECOND + 6 * PERIOD, 1.0, Verdict.UNKNOWN_STAMP),
        (SECOND + 5 * PERIOD + 1, 1.0, Verdict.UNKNOWN_STAMP),
        (SECOND + 5 * PERIOD - 1, 1.0, Verdict.UNKNOWN_STAMP),
        (SECOND - PERIOD, 1.0, Verdict.UNKNOWN_STAMP),
        (-SECOND, 1.0, Verdict.UNKNOWN_STAMP),
        (2**62, 1.0, Verdict.UNKNOWN_STAMP),
        (SECOND + 3 * PERIOD, 1.0, Verdict.ANSWERED),
    ],
)
def test_a_bad_force_is_dropped(realtime: bool, stamp: int, force: float, verdict: Verdict) -> None:
    """At sample 5, with an answer to sample 3."""
    loop = Loop(realtime)
    loop.advance_by(3)
    loop.answer(3, 0.25)
    loop.advance_by(2)
    assert loop.offer(stamp, force) is verdict
    assert loop.offer(stamp, force) is verdict
    assert dict(loop.answers.dropped) == {verdict: 2}
    assert not loop.answered
    # It leaves no trace.
    assert loop.answer(5, 0.75) is Verdict.ACCEPTED
    loop.advance()
    assert loop.acting == 0.75


def test_a_late_force_that_a_newer_one_replaces_before_it_acts_is_told() -> None:
    told: list[tuple[int, float]] = []
    loop = Loop(realtime=True, overtaken=lambda *force: told.append(force))
    loop.answer(0, 0.5)
    loop.advance_by(3)
    for number, force in ((1, 1.5), (2, 2.5), (3, 3.5)):
        assert loop.answer(number, force) is Verdict.ACCEPTED
    loop.advance()
    assert loop.acting == 3.5
    assert told == [(SECOND + PERIOD, 1.5), (SECOND + 2 * PERIOD, 2.5)]
    assert dict(loop.answers.dropped) == {Verdict.OVERTAKEN: 2}


@paces
def test_a_slower_controller_answers_each_third_sample(realtime: bool) -> None:
    loop, hand = Loop(realtime, answer_every=3), Motion(PAPER, 0.0, 0.0)
    for number in range(7):
        assert loop.answered == (number % 3 > 0)
        expected = Verdict.UNASKED if number % 3 else Verdict.ACCEPTED
        assert loop.answer(number, 0.5 + number) is expected
        assert loop.answered
        assert loop.command(9.0) is Verdict.SUPERSEDED
        hand.force = 0.5 + number - number % 3
        hand.advance(0.01)
        sample = loop.advance()
        assert (sample.position, sample.velocity) == (hand.position, hand.velocity)
    assert loop.answers.late_forces == 0
    assert dict(loop.answers.dropped) == {Verdict.UNASKED: 4}


@paces
def test_without_its_force_no_sample_is_in_time_up_to_the_next_that_asks(realtime: bool) -> None:
    loop = Loop(realtime, answer_every=3, force_timeout=1.0)
    loop.answer(0, 0.5)
    loop.advance_by(4)
    assert (loop.acting, loop.answers.late_forces) == (0.5 * realtime, 1)
    late = loop.answer(3, 1.5)
    assert late is (Verdict.ACCEPTED if realtime else Verdict.TOO_LATE)
    loop.advance_by(2)
    assert (loop.acting, loop.answers.late_forces) == ((1.5, 1) if realtime else (0.0, 3))
    loop.advance()
    assert loop.answers.late_forces == (2 if realtime else 4)


@paces
def test_a_controller_that_comes_after_a_gap_counts_from_its_first_sample(realtime: bool) -> None:
    loop = Loop(realtime, answer_every=3, force_timeout=0.0)
    loop.advance_by(5)
    assert loop.answer(4, 0.5) is (Verdict.ACCEPTED if realtime else Verdict.TOO_LATE)
    assert [number for number in range(4, 9) if loop.answers.asks(number)] == [4, 7]
    loop.advance_by(2)
    assert not loop.answered
    assert loop.answer(7, 0.5) is Verdict.ACCEPTED
    assert loop.answer(6, 0.5) is Verdict.UNASKED


def test_lockstep_goes_on_without_force_and_without_hope_where_none_comes() -> None:
    loop = Loop()
    assert loop.answers.controller_present
    loop.answer(0, 0.5)
    for acting, late in ((0.5, 0), (0.0, 1), (0.0, 2)):
        loop.advance()
        assert (loop.acting, loop.answers.late_forces) == (acting, late)
        assert loop.answers.controller_present == (late == 0)


@pytest.mark.parametrize("late", [False, True])
def test_lockstep_takes_its_controller_back(late: bool) -> None:
    """By an answer, also by one that comes too late: the next one may be in time."""
    loop = Loop()
    loop.advance_by(3)
    assert not loop.answers.controller_present
    assert loop.answer(2 if late else 3, 0.5) is (Verdict.TOO_LATE if late else Verdict.ACCEPTED)
    assert loop.answers.controller_present


@pytest.mark.parametrize(
    ("stamp", "force"), [(SECOND + 3 * PERIOD, nan), (0, 1.0), (SECOND + 1, 1.0)]
)
def test_a_bad_force_does_not_bring_the_controller_back(stamp: int, force: float) -> None:
    loop = Loop()
    loop.advance_by(3)
    loop.offer(stamp, force)
    assert not loop.answers.controller_present


def test_realtime_holds_the_newest_force_and_counts_what_is_late() -> None:
    loop = Loop(realtime=True)
    loop.advance()
    assert (loop.acting, loop.answers.late_forces) == (0.0, 1)
    loop.answer(1, 0.5)
    loop.advance()
    assert (loop.acting, loop.answers.late_forces) == (0.5, 1)
    loop.advance_by(2)
    assert (loop.acting, loop.answers.late_forces) == (0.5, 3)


def test_realtime_takes_a_late_answer_if_it_is_the_newest() -> None:
    loop = Loop(realtime=True)
    loop.advance_by(5)
    assert loop.answer(3, 0.5) is Verdict.ACCEPTED
    assert loop.answer(2, 0.75) is Verdict.ANSWERED
    assert not loop.answered
    loop.advance()
    assert (loop.acting, loop.answers.late_forces) == (0.5, 6)
    assert loop.answer(5, -0.25) is Verdict.ACCEPTED
    loop.advance()
    assert (loop.acting, loop.answers.late_forces) == (-0.25, 7)


def test_realtime_gives_a_force_up_that_is_too_old() -> None:
    """With a time-out of 30 ms the answer to sample 0 is held for samples 1, 2 and 3."""
    loop = Loop(realtime=True, force_timeout=0.03)
    loop.answer(0, 0.5)
    acting = []
    for _ in range(6):
        loop.advance()
        acting.append(loop.acting)
    assert acting == [0.5, 0.5, 0.5, 0.5, 0.0, 0.0]
    assert loop.answers.late_forces == 5
    assert loop.answer(5, 0.25) is Verdict.ACCEPTED
    loop.advance()
    assert loop.acting == 0.25


@paces
def test_nothing_is_late_where_no_control_is_expected(realtime: bool) -> None:
    loop = Loop(realtime, expects_control=False)
    assert not loop.answers.controller_present
    loop.advance_by(5)
    assert loop.answers.late_forces == 0
    assert not loop.answers.controller_present
    # A stranger's force is taken all the same, and nobody waits for the next one.
    assert loop.answer(5, 0.5) is Verdict.ACCEPTED
    loop.advance()
    assert loop.acting == 0.5
    assert not loop.answers.controller_present
    loop.advance()
    assert loop.answers.late_forces == 0


offers = st.tuples(
    st.one_of(
        st.integers(-3, 12).map(lambda number: SECOND + number * PERIOD),
        st.integers(-(2**62), 2**62),
    ),
    st.floats(),
)


@pytest.mark.parametrize("realtime", [False, True])
@given(st.lists(st.one_of(st.none(), offers), max_size=30))
def test_whatever_is_offered_every_sample_is_finite(
    realtime: bool, events: list[tuple[int, float] | None]
) -> None:
    MOTION.restart(0.0, 0.0)
    told: list[tuple[int, float]] = []
    loop = SampledLoop(
        MOTION, 100.0, SECOND, hold_late=realtime, overtaken=lambda *force: told.append(force)
    )
    taken = 0
    for event in events:
        if event is None:
            assert all(isfinite(figure) for figure in loop.advance()[:-1])
        else:
            taken += loop.offer(*event) is Verdict.ACCEPTED
    offered = sum(event is not None for event in events)
    overtaken = loop.answers.dropped[Verdict.OVERTAKEN]
    assert taken + loop.answers.dropped.total() - overtaken == offered
    assert overtaken == len(told)


SAMPLES = 30
UNIT = 1.0 / 64.0
NONE = -1

seeds = st.integers(0, 10**9)
thousandths = st.integers(0, 4000)
Switch = tuple[float, int]
"""An instant in periods, and the number of the force that acts from then on."""


class Told(Motion):
    """Keeps which force acted for how long (s)."""

    def __init__(self) -> None:
        super().__init__(PAPER, 0.0, 0.0)
        self.pieces: list[tuple[float, float]] = []

    def advance_under(self, control: float, disturbance: float, duration: float) -> None:
        self.pieces.append((control + disturbance, duration))
        super().advance_under(control, disturbance, duration)

    def begin(self) -> None:
        self.pieces.clear()
        self.force = 0.0
        self.restart(0.0, 0.0)


TOLD = Told()


def advanced(
    delay: float,
    jitter: float,
    seed: int,
    *,
    rate: float = 10.0,
    missing: Collection[int] = (),
    realtime: bool = False,
    overtaken: Callable[[int, float], None] = lambda stamp, force: None,
) -> Told:
    """The motion over all samples; delay and jitter in periods, force n being n + 1 units."""
    TOLD.begin()
    loop = SampledLoop(
        TOLD,
        rate,
        LOCKSTEP_START,
        force_delay=delay / rate,
        force_jitter=jitter / rate,
        force_jitter_seed=seed,
        hold_late=realtime,
        overtaken=overtaken,
    )
    for number in range(SAMPLES):
        if number not in missing:
            loop.offer(loop.sample.stamp, (number + 1) * UNIT)
        loop.advance()
    return TOLD


def merged(switches: list[Switch]) -> list[Switch]:
    """The switches at which something changes, there being no force at first."""
    changes = pairwise([(0.0, NONE), *switches])
    return [switch for before, switch in changes if switch[1] != before[1]]


def switches_of(motion: Told, rate: float = 10.0) -> list[Switch]:
    now = 0.0
    switches: list[Switch] = []
    for force, duration in motion.pieces:
        switches.append((now * rate, round(force / UNIT) - 1))
        now += duration
    return merged(switches)


def shares(seed: int) -> list[float]:
    """The share of the jitter that each force gets: where none can overtake, it is seen."""
    switches = switches_of(advanced(0.0, 1.0, seed, rate=1.0), 1.0)
    assert [number for _, number in switches] == list(range(SAMPLES))
    found = [instant - number for instant, number in switches]
    assert all(0.0 <= share < 1.0 for share in found)
    return found


def expected(delay: float, jitter: float, seed: int) -> list[Switch]:
    arrivals = [n + delay + jitter * share for n, share in enumerate(shares(seed))]
    return [
        (arrival, number)
        for number, arrival in enumerate(arrivals)
        if arrival < min([SAMPLES, *arrivals[number + 1 :]])
    ]


def test_a_seed_stands_for_the_same_shares_everywhere_and_always() -> None:
    found = shares(0)
    assert found[:4] == pytest.approx([0.84442185, 0.75795440, 0.42057158, 0.25891675], abs=1e-8)
    assert shares(1)[:4] == pytest.approx(
        [0.13436424, 0.84743374, 0.76377462, 0.25506903], abs=1e-8
    )


@given(thousandths, thousandths, seeds)
@example(delay=0, jitter=0, seed=0)
@example(delay=1000, jitter=0, seed=0)
@example(delay=1250, jitter=0, seed=0)
@example(delay=0, jitter=30_000, seed=0)
def test_the_newest_force_that_has_arrived_acts(delay: int, jitter: int, seed: int) -> None:
    """Delay and jitter in thousandths of a period."""
    found = switches_of(advanced(delay / 1000, jitter / 1000, seed))
    wanted = expected(delay / 1000, jitter / 1000, seed)
    assert [number for _, number in found] == [number for _, number in wanted]
    assert [instant for instant, _ in found] == pytest.approx([at for at, _ in wanted], abs=1e-8)


@pytest.mark.parametrize("realtime", [False, True])
@given(jitter=thousandths, missing=st.sets(st.integers(0, SAMPLES - 1)))
def test_the_substitute_for_a_missing_force_arrives_in_its_place(
    realtime: bool, jitter: int, missing: set[int]
) -> None:
    """In lockstep no force does, in real time the newest one before."""

    def stand_in(number: int) -> int:
        there = [n for n in range(number + 1) if n not in missing]
        if number not in missing:
            return number
        return there[-1] if realtime and there else NONE

    delays = (0.25, jitter / 1000, 3)
    found = switches_of(advanced(*delays, missing=missing, realtime=realtime))
    wanted = merged([(at, stand_in(number)) for at, number in switches_of(advanced(*delays))])
    assert [number for _, number in found] == [number for _, number in wanted]
    assert [instant for instant, _ in found] == pytest.approx([at for at, _ in wanted], abs=1e-8)


@pytest.mark.parametrize("realtime", [False, True])
@given(delay=thousandths, jitter=thousandths, missing=st.sets(st.integers(0, SAMPLES - 1)))
def test_a_force_acts_or_is_told_to_be_overtaken_or_is_still_under_way(
    realtime: bool, delay: int, jitter: int, missing: set[int]
) -> None:
    told: list[int] = []
    motion = advanced(
        delay / 1000,
        jitter / 1000,
        3,
        missing=missing,
        realtime=realtime,
        overtaken=lambda _, force: told.append(round(force / UNIT) - 1),
    )
    acted = {round(force / UNIT) - 1 for force, duration in motion.pieces if duration > 0.0}
    sent = set(range(SAMPLES)) - missing
    assert sorted(set(told)) == sorted(told)
    assert set(told).isdisjoint(acted)
    assert set(told) <= sent
    assert all(number > max(acted) for number in sent - acted - set(told))
