"""The stamps and instants of samples."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.motion.motion import Motion
from tests.physics.drives import FEED_DRIVE, PAPER

SECOND = 10**9

MOTION = Motion(PAPER, 0.0, 0.0)
"""For what does not advance."""


@pytest.mark.parametrize("rate", [3, 7, 30, 60, 100, 1000, 30_000])
@pytest.mark.parametrize("number", [0, 1, 2, 1000, 10**9, 10**9 + 1])
@pytest.mark.parametrize("start", [SECOND, 1_700_000_000_123_456_789])
def test_stamps_are_exact_for_ever(rate: int, number: int, start: int) -> None:
    stamp = SampledLoop(MOTION, float(rate), start).stamp(number)
    # |stamp - (start + n 1e9 / f)| is half a nanosecond at most, in whole numbers.
    assert abs((stamp - start) * rate - number * SECOND) * 2 <= rate


@given(st.floats(1e-3, 1e9), st.integers(0, 10**9))
def test_a_stamp_has_one_number(rate: float, number: int) -> None:
    loop = SampledLoop(MOTION, rate, SECOND)
    assert loop.number(loop.stamp(number)) == number


@pytest.mark.parametrize("rate", [3.0, 30.0, 1000.0])
def test_samples_are_a_period_apart(rate: float) -> None:
    motion, free = Motion(PAPER, 0.0, 0.0), Motion(PAPER, 0.0, 0.0)
    loop = SampledLoop(motion, rate, SECOND)
    first = loop.sample
    assert loop.sample_number == 0
    assert (first.stamp, first.position, first.velocity) == (SECOND, 0.0, 0.0)
    for number in range(1, 40):
        sample = loop.advance()
        free.advance(1.0 / rate)
        assert sample == loop.sample
        assert loop.sample_number == number
        assert sample.stamp == loop.stamp(number)
        assert (sample.position, sample.velocity) == (free.position, free.velocity)


def test_the_belt_moves_on() -> None:
    loop = SampledLoop(Motion(FEED_DRIVE, 0.0, 0.0), 1000.0, SECOND)
    assert (loop.sample.belt_position, loop.sample.belt_velocity) == (0.0, 0.04)
    for _ in range(10):
        loop.advance()
    assert loop.sample.belt_position == pytest.approx(10 * 0.04 / 1000.0)
    loop.change_drive(replace(FEED_DRIVE, belt_speed=-0.02))
    for _ in range(6):
        loop.advance()
    # The sixteenth sample: eleven periods at the old speed, five at the new one.
    assert loop.sample.belt_position == pytest.approx((11 * 0.04 - 5 * 0.02) / 1000.0)
    assert loop.sample.belt_velocity == -0.02


def test_friction_is_that_under_the_force_held_up_to_the_sample() -> None:
    """Riding the belt at 0.4, at x = 0.04 after a tenth of a second."""
    loop = SampledLoop(Motion(PAPER, 0.0, 0.4), 10.0, SECOND)
    loop.offer(loop.sample.stamp, 0.1)
    assert loop.advance().friction_force == pytest.approx(0.04 + 0.02 * 0.4 - 0.1)
    loop.offer(loop.sample.stamp, -0.2)
    assert loop.sample.friction_force == pytest.approx(0.04 + 0.02 * 0.4 - 0.1)
    assert loop.advance().friction_force == pytest.approx(0.08 + 0.02 * 0.4 + 0.2)
