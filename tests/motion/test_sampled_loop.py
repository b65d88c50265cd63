"""The sampled loop: stamps, changes under way, the sensor and the actuator."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.measures import CycleMeter
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.control import VelocityFeedback
from stickslip_ros.model.sensor import MeasuredVelocity, Sensor
from stickslip_ros.model.signals import sine, step
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.force_answers import Verdict
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.motion.sampler import SampleStamps
from stickslip_ros.motion.simulation import simulate_sampled
from stickslip_ros.motion.trajectory import TrajectoryRecorder
from stickslip_ros.samples import Sample
from tests.drives import FEED_DRIVE, PAPER, lag

SECOND = 10**9


@given(st.integers(1, 10**9), st.integers(0, 10**10), st.integers(SECOND, 2 * 10**18))
def test_stamps_are_exact_for_ever(rate: int, number: int, start: int) -> None:
    stamp = SampleStamps(start, float(rate)).stamp(number)
    # |stamp - (start + n 1e9 / f)| is half a nanosecond at most, in whole numbers.
    assert abs((stamp - start) * rate - number * SECOND) * 2 <= rate


@given(st.floats(1e-3, 1e9), st.integers(0, 10**9))
def test_a_stamp_has_one_number(rate: float, number: int) -> None:
    stamps = SampleStamps(SECOND, rate)
    assert stamps.number(stamps.stamp(number)) == number


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
        assert sample.stamp == loop.stamps.stamp(number)
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
    assert loop.applied_force == 0.1
    loop.offer(loop.sample.stamp, -0.2)
    assert loop.sample.friction_force == pytest.approx(0.04 + 0.02 * 0.4 - 0.1)
    assert loop.advance().friction_force == pytest.approx(0.08 + 0.02 * 0.4 + 0.2)


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


def test_disturbances_and_control_add_up_and_only_control_is_delayed() -> None:
    """A new disturbance of the scenario acts from the next sample on."""
    motion = Motion(PAPER, 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND, force_delay=0.3, disturbance=step(0.5, start=0.1))
    loop.offer(loop.sample.stamp, 2.0)
    assert acting(loop, motion, 2) == [0.0, 0.5]
    loop.disturb(0.25)
    loop.follow_disturbance(step(0.125))
    assert loop.disturbance == 0.5
    assert acting(loop, motion, 2) == [0.5, 2.375]


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


def test_drive_and_position_may_change_at_once() -> None:
    loop = SampledLoop(Motion(PAPER, 0.0, 0.0), 10.0, SECOND)
    loop.change_drive(replace(PAPER, normal_force=2.0))
    loop.reset(0.3, -0.1)
    sample = loop.advance()
    assert (sample.position, sample.velocity) == (0.3, -0.1)


RATE = 10.0


ENCODER = Sensor(0.005, 0.01, MeasuredVelocity.DIFFERENCE)
"""Resolution and noise in m."""


def test_a_reset_starts_its_history_again() -> None:
    loop = SampledLoop(Motion(PAPER, 0.1, -0.2), RATE, SECOND, sensor=ENCODER)
    for _ in range(5):
        loop.advance()
    assert loop.sample.velocity != 0.0
    loop.reset(0.3, -0.1)
    loop.advance()
    assert (loop.true_sample.position, loop.true_sample.velocity) == (0.3, -0.1)
    assert loop.sample.velocity == 0.0
    before = loop.sample.position
    loop.advance()
    assert loop.sample.velocity == pytest.approx((loop.sample.position - before) * RATE)


def test_a_controller_sees_what_is_measured_and_the_record_is_true() -> None:
    seen: list[Sample] = []

    class Watching(Controller):
        def answer(self, sample: Sample) -> float | None:
            seen.append(sample)
            return super().answer(sample)

    law = VelocityFeedback(velocity_gain=-0.2)
    motion = RecordedMotion(PAPER, 0.1, -0.2)
    loop = SampledLoop(motion, RATE, SECOND, sensor=ENCODER)
    recorder = TrajectoryRecorder(RATE)
    simulate_sampled(loop, motion, Watching(law), 3.0, CycleMeter(2), recorder=recorder)
    trajectory = recorder.trajectory()

    hand, measure = Motion(PAPER, 0.1, -0.2), ENCODER.start(1.0 / RATE)
    for number, sample in enumerate(seen):
        assert (sample.position, sample.velocity) == measure(hand.position, hand.velocity)
        row = trajectory[number : number + 1]
        assert (row.position[0], row.velocity[0]) == (hand.position, hand.velocity)
        assert row.control_force[0] == pytest.approx(-0.2 * sample.velocity, rel=1e-13)
        hand.force = -0.2 * sample.velocity
        hand.advance(1.0 / RATE)
    assert len(seen) == len(trajectory) == 31
    assert np.ptp(trajectory.control_force) > 0.0


def commands(number: int) -> float:
    return 0.5 * (-1.0) ** number * (1.0 + 0.1 * number)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.25])
def test_a_command_is_limited_when_it_arrives_and_then_held(delay: float) -> None:
    """Delay in periods; the arrived force acts, and none before the first."""
    motion = Motion(replace(PAPER, actuator=Actuator(limit=0.6)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND, force_delay=delay / 10.0)
    acting: list[float] = []
    for number in range(8):
        loop.offer(loop.sample.stamp, commands(number))
        loop.advance()
        acting.append(motion.force)
    arrived = int(delay)
    sent = [max(-0.6, min(0.6, commands(number))) for number in range(8)]
    assert acting == [0.0] * arrived + sent[: 8 - arrived]


def test_a_disturbance_is_not_limited() -> None:
    motion = Motion(replace(PAPER, actuator=Actuator(limit=0.1)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND, disturbance=step(5.0))
    loop.offer(SECOND, 3.0)
    loop.advance()
    assert motion.force == 5.1


@pytest.mark.parametrize("time_constant", [0.0, 0.05])
def test_a_new_actuator_limits_from_the_next_command_on(time_constant: float) -> None:
    motion = Motion(replace(PAPER, actuator=lag(time_constant)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND)
    forces: list[float] = []
    for number, largest in enumerate((0.4, 0.2, 5.0, 5.0)):
        loop.offer(loop.sample.stamp, 3.0)
        actuator = Actuator(limit=largest, time_constant=time_constant)
        loop.change_drive(replace(PAPER, actuator=actuator))
        loop.advance()
        forces.append(motion.force)
        assert loop.sample_number == number + 1
    assert forces == [3.0, 0.4, 0.2, 3.0]


def test_a_reset_puts_the_lag_at_rest() -> None:
    motion = Motion(replace(PAPER, actuator=lag(0.5)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND)
    for _ in range(10):
        loop.offer(loop.sample.stamp, 1.0)
        loop.advance()
    assert motion.applied_force > 0.8
    loop.reset(0.1, 0.0)
    loop.offer(loop.sample.stamp, 1.0)
    loop.advance()
    assert motion.applied_force == 0.0


def test_the_first_command_answers_a_sample_and_a_silent_one_holds_it() -> None:
    loop, other = (SampledLoop(Motion(FEED_DRIVE, 0.0, 0.0), 1000.0, SECOND) for _ in range(2))
    assert loop.command(np.nan) is Verdict.NOT_FINITE
    assert [loop.command(force) for force in (5.0, 7.0)] == [Verdict.ACCEPTED, Verdict.SUPERSEDED]
    other.offer(other.sample.stamp, 5.0)
    assert loop.advance() == other.advance()
    loop.hold()
    other.offer(other.sample.stamp, 5.0)
    assert loop.advance() == other.advance()
    answers = loop.answers
    assert (answers.silent_samples, answers.late_forces, answers.dropped.total()) == (1, 0, 1)


def test_a_command_with_an_instant_acts_from_then_until_the_next() -> None:
    motion = Motion(FEED_DRIVE, 0.0, 0.0)
    loop = SampledLoop(motion, 1000.0, SECOND, force_delay=0.25e-3)
    loop.command(50.0, 0.5)
    loop.command(-20.0, 1.0)
    samples = [loop.advance() for _ in range(3)]
    free = Motion(FEED_DRIVE, 0.0, 0.0)
    expected: list[float] = []
    for force, duration in ((0.0, 0.75e-3), (50.0, 0.25e-3), (50.0, 0.25e-3), (-20.0, 1.75e-3)):
        free.set_forces(force, 0.0)
        free.advance(duration)
        expected.append(free.position)
    assert samples[0].position == pytest.approx(expected[1], rel=1e-12)
    assert samples[2].position == pytest.approx(expected[3], rel=1e-12)
    assert loop.answers.late_forces == 0
