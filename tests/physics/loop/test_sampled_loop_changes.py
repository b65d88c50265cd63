"""Disturbances, new drives and resets act from the next sample on."""

from dataclasses import replace

import pytest

from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.model.friction import Linear
from stickslip_ros.physics.model.signals import sine, step
from stickslip_ros.physics.motion.motion import Motion
from tests.physics.drives import PAPER

SECOND = 10**9


def acting(loop: SampledLoop, motion: Motion, samples: int) -> list[float]:
    """The force that acts after each of the samples, the loop being without control."""
    forces = []
    for _ in range(samples):
        loop.advance()
        forces.append(motion.force)
    return forces


def test_the_disturbance_of_the_scenario() -> None:
    motion = Motion(PAPER, 0.0, 0.0)
    # A quarter of a turn from sample to sample.
    disturbance = sine(0.5, frequency=2.5)
    loop = SampledLoop(motion, 10.0, SECOND, disturbance=disturbance)
    seen = [loop.disturbance]
    forces = []
    for _ in range(5):
        loop.advance()
        seen.append(loop.disturbance)
        forces.append(motion.force)
    assert forces == pytest.approx([0.0, 0.5, 0.0, -0.5, 0.0], abs=1e-15)
    # What is said to act from a sample on is what acts.
    assert seen[:5] == forces


def test_a_disturbance_that_is_asked_for_acts_from_the_next_sample_until_the_next_one() -> None:
    motion = Motion(PAPER, 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND)
    loop.disturb(0.5)
    assert loop.disturbance == 0.0
    assert acting(loop, motion, 3) == [0.0, 0.5, 0.5]
    assert loop.disturbance == 0.5
    loop.disturb(-0.25)
    assert acting(loop, motion, 2) == [0.5, -0.25]
    loop.disturb(0.0)
    assert acting(loop, motion, 2) == [-0.25, 0.0]


def test_the_delay_is_that_of_the_control_force_only() -> None:
    motion = Motion(PAPER, 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND, force_delay=0.3, disturbance=step(0.5, start=0.1))
    assert acting(loop, motion, 3) == [0.0, 0.5, 0.5]


def test_a_new_drive_acts_from_the_next_sample() -> None:
    heavy = replace(PAPER, mass=3.0, belt_speed=0.1)
    loop, hand = SampledLoop(Motion(PAPER, 0.0, 0.0), 10.0, SECOND), Motion(PAPER, 0.0, 0.0)
    loop.advance()
    loop.change_drive(heavy)
    assert loop.sample.belt_velocity == 0.4
    hand.advance(0.1)
    hand.advance(0.1)
    sample = loop.advance()
    assert sample.position == pytest.approx(hand.position, rel=1e-13)
    assert sample.velocity == pytest.approx(hand.velocity, rel=1e-13)
    # Sampled before the change: friction under the old drive.
    assert sample.friction_force == hand.friction_force
    assert sample.belt_velocity == 0.1
    hand.drive = heavy
    hand.advance(0.1)
    sample = loop.advance()
    assert sample.position == pytest.approx(hand.position, rel=1e-13)
    assert sample.velocity == pytest.approx(hand.velocity, rel=1e-13)


def test_a_reset_puts_the_slide_back_at_the_next_sample_while_time_goes_on() -> None:
    loop, fresh = SampledLoop(Motion(PAPER, 0.0, 0.0), 10.0, SECOND), Motion(PAPER, 0.3, -0.1)
    for _ in range(3):
        loop.advance()
    belt_position = loop.sample.belt_position
    loop.reset(0.3, -0.1)
    assert (loop.sample.position, loop.sample.velocity) != (0.3, -0.1)
    sample = loop.advance()
    assert (loop.sample_number, sample.stamp) == (4, SECOND + 4 * SECOND // 10)
    assert (sample.position, sample.velocity) == (0.3, -0.1)
    assert sample.belt_position == pytest.approx(belt_position + 0.04)
    sample = loop.advance()
    fresh.advance(0.1)
    assert (sample.position, sample.velocity) == (fresh.position, fresh.velocity)


def test_a_diverging_motion_is_reported() -> None:
    drive = replace(PAPER, friction=Linear(static=0.4, slope=0.9))
    loop = SampledLoop(Motion(drive, 0.0, 0.0), 10.0, SECOND)
    for _ in range(100):
        loop.advance()
    assert not loop.unbounded
    for _ in range(500):
        loop.advance()
    assert loop.unbounded


def test_disturbances_and_control_add_up() -> None:
    motion = Motion(PAPER, 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND, disturbance=step(0.5))
    loop.disturb(0.25)
    loop.advance()
    loop.offer(loop.sample.stamp, 2.0)
    loop.advance()
    assert motion.force == 2.75


def test_a_new_disturbance_of_the_scenario_acts_from_the_next_sample() -> None:
    motion = Motion(PAPER, 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND)
    loop.advance()
    loop.follow_disturbance(step(0.5))
    assert loop.disturbance == 0.0
    assert acting(loop, motion, 2) == [0.0, 0.5]


def test_drive_and_position_may_change_at_once() -> None:
    loop = SampledLoop(Motion(PAPER, 0.0, 0.0), 10.0, SECOND)
    loop.change_drive(replace(PAPER, normal_force=2.0))
    loop.reset(0.3, -0.1)
    sample = loop.advance()
    assert (sample.position, sample.velocity) == (0.3, -0.1)
