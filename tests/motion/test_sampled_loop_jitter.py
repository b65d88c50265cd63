"""Forces with jitter: arrival times vary, and the newest arrived force acts."""

from collections.abc import Callable, Collection
from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.control import Washout
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.motion.simulation import simulate_sampled
from tests.drives import FEED_DRIVE, PAPER

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


MOTION = Told()


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
    MOTION.begin()
    loop = SampledLoop(
        MOTION,
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
    return MOTION


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


def controlled(delay: float, jitter: float) -> Measures:
    """The feed drive with its washout, from half a second on; 1 ms from sample to sample."""
    motion = RecordedMotion(FEED_DRIVE, 0.0, 0.0)
    loop = SampledLoop(
        motion,
        1000.0,
        LOCKSTEP_START,
        force_delay=delay,
        force_jitter=jitter,
    )
    law = Controller(Washout(20.0, -3000.0, 0.0, start_after=0.5))
    return simulate_sampled(loop, motion, law, 5.0, CycleMeter(20))


def test_a_small_jitter_leaves_the_washout_stable_and_a_large_one_does_not() -> None:
    """Theory has it stable up to a constant delay of 10.45 ms."""
    assert controlled(0.008, 0.001).regime is Regime.EQUILIBRIUM
    assert 1e-4 < (controlled(0.008, 0.01).amplitude or 0.0) < 2.5e-4
    assert controlled(0.008, 0.05).regime is Regime.STICK_SLIP
    # Forces that overtake keep the acting one young: twice the critical delay does no harm.
    assert controlled(0.0, 0.02).regime is Regime.EQUILIBRIUM
