"""Slide and motor leave the guide when the forces on them exceed their dry friction."""

import numpy as np
import pytest

import stickslip_ros as ss
from benchmarks.random_releases import released
from stickslip_ros.motion import Motion


def test_a_motor_that_friction_just_holds_is_released() -> None:
    """Rounding put the friction that it needs below the limit, at the instant of the release."""
    drive = ss.scenario("feed_drive_motor", "plant.motor.mass=40", "plant.damping=2000").plant
    motion = Motion(drive.as_drive(), 0.0, 0.0)
    motion.restart(0.0003717063578472491, 0.03237567876097893, motor=(0.0, 0.04))
    motion.set_forces(-364.86471500329105, 0.0)
    motion.advance(0.015)
    assert motion.motor is not None
    assert 0.039 < motion.motor.velocity < 0.0395


@pytest.mark.parametrize(
    "seed",
    [n if n in (0, 1, 2, 20) else pytest.param(n, marks=pytest.mark.long) for n in range(50)],
)
def test_releases_agree_with_an_independent_solution(seed: int) -> None:
    drive = released(seed)
    assert np.all(np.abs(drive.motion() - drive.solution()) < 1e-9 * drive.ranges)
