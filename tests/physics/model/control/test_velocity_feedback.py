"""Velocity feedback is a damper and a spring."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.model.control import NO_REFERENCE, VelocityFeedback
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.motion import Motion
from stickslip_ros.samples import Sample
from tests.physics.drives import FEED_DRIVE, PAPER


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_the_force_is_that_of_a_damper_and_a_spring(
    velocity_gain: float, position_gain: float, position: float, velocity: float
) -> None:
    law = VelocityFeedback(velocity_gain, position_gain)
    sample = Sample(0, position, velocity, 0.0, 0.0, 0.0)
    force, state = law.respond((), 0.1, sample, NO_REFERENCE)
    assert force == position_gain * position + velocity_gain * velocity
    assert state == law.initial_state(sample, NO_REFERENCE) == ()
    assert Controller(law).answer(sample) == force


@pytest.mark.parametrize("drive", [PAPER, FEED_DRIVE], ids=["paper", "feed_drive"])
@pytest.mark.parametrize(("damping", "stiffness"), [(0.3, 0.0), (-0.01, 0.0), (0.1, 0.5)])
def test_without_sampling_it_is_a_drive_with_other_damping_and_stiffness(
    drive: Drive, damping: float, stiffness: float
) -> None:
    """Through stick and slip; shares of the critical damping and of the stiffness."""
    damper = damping * (drive.stiffness * drive.mass) ** 0.5
    spring = stiffness * drive.stiffness
    control = VelocityFeedback(-damper, -spring).continuous
    controlled = Motion(drive, 0.0, drive.belt_speed, control)
    other = Motion(
        replace(drive, damping=drive.damping + damper, stiffness=drive.stiffness + spring),
        0.0,
        drive.belt_speed,
    )
    modes: set[bool] = set()
    for _ in range(40):
        for motion in (controlled, other):
            motion.advance(0.5 / drive.angular_frequency)
        modes.add(other.sticking)
        assert controlled.sticking == other.sticking
        found = controlled.position / drive.length_scale, controlled.velocity / drive.speed_scale
        wanted = other.position / drive.length_scale, other.velocity / drive.speed_scale
        assert found == pytest.approx(wanted, abs=1e-12)
        force = -damper * controlled.velocity - spring * controlled.position
        assert controlled.applied_force == pytest.approx(force, abs=1e-12 * drive.normal_force)
    assert modes == {True, False}
