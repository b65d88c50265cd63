"""Changes during the motion of a drive."""

from dataclasses import replace

import pytest

from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Exponential
from stickslip_ros.motion.motion import Motion
from tests.drives import FEED_DRIVE, PAPER

CHANGES = {
    "heavier": replace(FEED_DRIVE, mass=250.0),
    "stiffer": replace(FEED_DRIVE, stiffness=3e6),
    "pressed harder": replace(FEED_DRIVE, normal_force=2000.0),
    "more damped": replace(FEED_DRIVE, damping=500.0),
    "slower belt": replace(FEED_DRIVE, belt_speed=0.03),
    "reversed belt": replace(FEED_DRIVE, belt_speed=-0.04),
    "another law": replace(FEED_DRIVE, friction=Exponential(0.3, 0.2, 0.02, 0.0)),
    "all at once": Drive(10.0, 3.0, 2e5, 500.0, 0.1, Coulomb(0.5)),
}


@pytest.mark.parametrize("changed", CHANGES.values(), ids=CHANGES.keys())
def test_from_then_on_it_moves_as_the_new_drive(changed: Drive) -> None:
    motion = Motion(FEED_DRIVE, 0.0, 0.0)
    motion.force = 30.0
    motion.advance(0.05)
    position, velocity = motion.position, motion.velocity
    fresh = Motion(changed, position, velocity)
    fresh.force = 30.0
    motion.drive = changed
    found = motion.position, motion.velocity, motion.force
    assert found == pytest.approx((position, velocity, 30.0), rel=1e-14)
    motion.advance(0.2)
    fresh.advance(0.2)
    assert motion.position == pytest.approx(fresh.position, rel=1e-9)
    assert motion.velocity == pytest.approx(fresh.velocity, rel=1e-9)
    assert motion.friction_force == pytest.approx(fresh.friction_force, rel=1e-9)


def test_a_belt_that_changes_speed_leaves_the_slide_behind() -> None:
    motion = Motion(FEED_DRIVE, 0.0, 0.04)
    motion.advance(0.001)
    assert motion.sticking
    motion.drive = replace(FEED_DRIVE, belt_speed=0.05)
    assert motion.velocity == pytest.approx(0.04, rel=1e-14)
    assert not motion.sticking
    motion.drive = FEED_DRIVE
    assert motion.sticking
    assert motion.velocity == 0.04


def test_restart_puts_the_slide_somewhere_else_and_keeps_the_force() -> None:
    motion = Motion(PAPER, 0.0, 0.0)
    motion.force = 0.2
    motion.advance(3.0)
    motion.restart(0.3, -0.1)
    fresh = Motion(PAPER, 0.3, -0.1)
    fresh.force = 0.2
    assert (motion.position, motion.velocity) == (0.3, -0.1)
    motion.advance(2.0)
    fresh.advance(2.0)
    assert motion.position == fresh.position
    assert motion.velocity == fresh.velocity


def test_restart_puts_the_filter_of_the_continuous_controller_to_rest() -> None:
    motion = Motion(FEED_DRIVE, 0.0, 0.0, Washout(20.0, -3000.0, 0.0))
    motion.advance(0.3)
    assert abs(motion.applied_force) > 1.0
    motion.restart(1e-4, -0.08)
    # It has let nothing through of the constant speed that it is taken to have seen.
    assert motion.applied_force == pytest.approx(0.0, abs=1e-2)
