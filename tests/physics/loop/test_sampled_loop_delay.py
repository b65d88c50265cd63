"""Force n acts from n T + delay to (n + 1) T + delay."""

from itertools import pairwise
from math import floor

import pytest

from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.motion.motion import Motion
from tests.physics.drives import PAPER

RATE = 10.0
PERIOD = 0.1
FORCES = [0.8, -1.1, 0.3, 1.7, -0.6, 0.9, -1.4, 0.2, 1.2, -0.9, 0.4, 0.1]


def by_hand(delay: float, samples: int) -> list[tuple[float, float]]:
    """The states at the samples of a motion whose force is switched at the instants it should."""
    motion = Motion(PAPER, 0.0, 0.0)
    states = []
    # In periods, and rounded so that an instant is not met twice.
    switches = {round(n + delay / PERIOD, 9) for n in range(samples)}
    instants = sorted(switches | set(map(float, range(samples + 1))))
    for before, after in pairwise(instant for instant in instants if instant <= samples):
        number = floor((before + after) / 2.0 - delay / PERIOD)
        motion.force = FORCES[number] if number >= 0 else 0.0
        motion.advance((after - before) * PERIOD)
        if after == round(after):
            states.append((motion.position, motion.velocity))
    return states


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.0999, 0.1, 0.17, 0.2, 0.25, 0.3, 0.7, 0.75])
@pytest.mark.parametrize("realtime", [False, True])
def test_a_force_acts_delayed_and_for_one_period(delay: float, realtime: bool) -> None:
    loop = SampledLoop(Motion(PAPER, 0.0, 0.0), RATE, 10**9, force_delay=delay, hold_late=realtime)
    states = []
    for force in FORCES:
        loop.offer(loop.sample.stamp, force)
        sample = loop.advance()
        states.append((sample.position, sample.velocity))
    expected = by_hand(delay, len(FORCES))
    assert len(expected) == len(states)
    for state, by_hand_state in zip(states, expected, strict=True):
        assert state == pytest.approx(by_hand_state, rel=1e-11, abs=1e-12)


def test_forces_differ_enough_to_tell_delays_apart() -> None:
    ends = [by_hand(delay, len(FORCES))[-1][0] for delay in (0.0, 0.03, 0.1, 0.17, 0.2, 0.75)]
    assert all(abs(one - other) > 1e-3 for one, other in pairwise(sorted(ends)))


def test_a_missing_force_is_missing_after_the_delay() -> None:
    """Lockstep: nothing answers sample 1, so from 0.35 s to 0.45 s there is no force."""
    motion = Motion(PAPER, 0.0, 0.0)
    loop = SampledLoop(motion, RATE, 10**9, force_delay=0.25)
    acting = []
    for number, force in enumerate([1.0, 2.0, 3.0, 4.0, 5.0]):
        if number != 1:
            loop.offer(loop.sample.stamp, force)
        loop.advance()
        acting.append(motion.force)  # that at the end of the period
    assert acting == [0.0, 0.0, 1.0, 0.0, 3.0]
