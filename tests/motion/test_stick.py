"""How the slide sticks to the belt, leaves it and passes its speed.

The paper's drive has scales of one, a static coefficient of 0.4 and damping 0.02: at belt speed v
the friction that holds the slide at x is h = x + 0.02 v - u, and 0.4 is the most it can be.
"""

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stickslip_ros.model.drive_system import DriveSystem
from stickslip_ros.model.friction import Coulomb, Directional, Stribeck
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.motion import Motion, RecordedMotion
from tests.drives import FEED_DRIVE, PAPER

BELT = 0.2
SLOW = replace(PAPER, belt_speed=BELT)
directions = pytest.mark.parametrize("direction", [1.0, -1.0])


def test_the_slide_rides_the_belt_exactly() -> None:
    motion = Motion(FEED_DRIVE, 0.0, FEED_DRIVE.belt_speed)
    motion.advance(0.005)
    assert motion.sticking
    assert motion.velocity == FEED_DRIVE.belt_speed
    assert motion.position == pytest.approx(0.04 * 0.005, rel=1e-14)
    # k x + c v_belt
    assert motion.friction_force == pytest.approx(1e6 * 0.04 * 0.005 + 200.0 * 0.04, rel=1e-14)


@directions
def test_it_breaks_away_where_friction_can_no_longer_hold_it(direction: float) -> None:
    drive = replace(PAPER, belt_speed=direction * BELT)
    motion = RecordedMotion(drive, 0.0, direction * BELT)
    limit = 0.4 - 0.02 * BELT
    motion.advance(limit / BELT - 1e-9)
    assert motion.sticking
    motion.advance(1e-3)
    assert not motion.sticking
    assert direction * (motion.velocity - drive.belt_speed) < 0.0
    breakpoints = motion.take_breakpoints()
    (left,) = breakpoints.time[breakpoints.sticking][1:]
    assert left == pytest.approx(limit / BELT, rel=1e-14)
    (place,) = breakpoints.position[breakpoints.sticking][1:]
    assert place == pytest.approx(direction * limit, rel=1e-14)


@pytest.mark.parametrize("system", [drive_system, DriveSystem], ids=["plain", "any"])
@given(
    damping=st.floats(0.0, 0.5),
    belt=st.floats(0.05, 1.0),
    force=st.floats(-1.0, 1.0),
    rounding=st.integers(-3, 3),
)
@example(damping=0.1, belt=0.3, force=0.0, rounding=1)
@example(damping=0.15, belt=0.4, force=0.1, rounding=0)
def test_rounding_at_the_limit_does_not_hold_the_slide_for_ever(
    system: Any, damping: float, belt: float, force: float, rounding: int
) -> None:
    """However large friction is forward: it slips backward."""
    law = Directional(Stribeck(0.6, 0.1, 0.5), PAPER.friction)
    drive = replace(PAPER, damping=damping, belt_speed=belt, friction=law)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("stickslip_ros.motion.motion.drive_system", system)
        motion = Motion(drive, 0.0, 0.0)
    motion.force = force
    at_limit = 0.4 - damping * belt + force
    motion.restart(at_limit * (1.0 + rounding * 2.0**-52), belt)
    motion.advance(1e-3)
    assert not motion.sticking


@pytest.mark.parametrize(("start", "end"), [(1.5, -0.1), (-1.5, 0.1), (0.5, 0.3), (2.05, 0.35)])
def test_on_a_belt_at_rest_coulomb_friction_takes_the_same_from_every_swing(
    start: float, end: float
) -> None:
    """Undamped, each swing ends 2 mu_s = 0.8 nearer: 1.5, -0.7, -0.1; and sticks within 0.4."""
    motion = Motion(replace(PAPER, damping=0.0, belt_speed=0.0, friction=Coulomb(0.4)), start, 0.0)
    motion.advance(20.0)
    assert motion.sticking
    assert motion.velocity == 0.0
    assert motion.position == pytest.approx(end, rel=1e-12)
