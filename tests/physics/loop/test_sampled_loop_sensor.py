"""The sensor in the loop: what a controller sees, and what is measured of the motion."""

from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np
import pytest

from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.loop.simulation import simulate_sampled
from stickslip_ros.physics.loop.trajectory import TrajectoryRecorder
from stickslip_ros.physics.measures import CycleMeter
from stickslip_ros.physics.model.control import VelocityFeedback
from stickslip_ros.physics.model.sensor import Measure, Sensor
from stickslip_ros.physics.motion import Motion, RecordedMotion
from stickslip_ros.samples import Sample
from tests.physics.drives import PAPER

SECOND = 10**9
RATE = 10.0


@dataclass(frozen=True)
class Encoder(Sensor):
    """Noise on the position, rounded; the velocity is a difference, zero at first."""

    noise: float = 0.01
    resolution: float = 0.005

    def start(self, period: float) -> Measure:
        last: list[float] = []

        def measure(number: int, position: float, velocity: float) -> tuple[float, float]:
            noise = Random(number).gauss(0.0, self.noise)
            measured = self.resolution * round((position + noise) / self.resolution)
            speed = (measured - last[0]) / period if last else 0.0
            last[:] = [measured]
            return measured, speed

        return measure


def loops(**options: Any) -> tuple[SampledLoop, SampledLoop]:
    """One with the encoder, one without."""
    return (
        SampledLoop(Motion(PAPER, 0.1, -0.2), RATE, SECOND, sensor=Encoder(), **options),
        SampledLoop(Motion(PAPER, 0.1, -0.2), RATE, SECOND, **options),
    )


def test_samples_are_measured_and_the_motion_is_true() -> None:
    measured, true = loops()
    last: float | None = None
    for number in range(30):
        assert measured.true_sample == true.true_sample == true.sample
        noise = Random(number).gauss(0.0, 0.01)
        position = 0.005 * round((true.sample.position + noise) / 0.005)
        velocity = 0.0 if last is None else (position - last) * RATE
        last = position
        expected = true.sample._replace(position=position, velocity=velocity)
        assert measured.sample == pytest.approx(expected, rel=1e-13)
        # The belt and friction are known.
        assert measured.sample[3:] == true.sample[3:]
        assert measured.sample.stamp == true.sample.stamp
        assert measured.advance() is measured.sample
        true.advance()


def test_a_reset_starts_its_history_again() -> None:
    loop, _ = loops()
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
    loop = SampledLoop(motion, RATE, SECOND, sensor=Encoder())
    recorder = TrajectoryRecorder(RATE)
    simulate_sampled(loop, motion, Watching(law), 3.0, CycleMeter(2), recorder=recorder)
    trajectory = recorder.trajectory()

    hand, last = Motion(PAPER, 0.1, -0.2), None
    for number, sample in enumerate(seen):
        noise = Random(number).gauss(0.0, 0.01)
        position = 0.005 * round((hand.position + noise) / 0.005)
        velocity = 0.0 if last is None else (position - last) * RATE
        last = position
        assert (sample.position, sample.velocity) == pytest.approx((position, velocity), rel=1e-13)
        row = trajectory[number : number + 1]
        assert (row.position[0], row.velocity[0]) == (hand.position, hand.velocity)
        assert row.control_force[0] == pytest.approx(-0.2 * velocity, rel=1e-13)
        hand.force = -0.2 * sample.velocity
        hand.advance(1.0 / RATE)
    assert len(seen) == len(trajectory) == 31
    assert np.ptp(trajectory.control_force) > 0.0
