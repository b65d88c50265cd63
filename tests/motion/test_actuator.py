"""Drives whose actuator has a lag: the force follows the command, and is a part of the motion."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from stickslip_ros.model.friction import Coulomb, Dahl, Stribeck
from stickslip_ros.model.signals import ramp
from stickslip_ros.motion import Motion, RecordedMotion
from tests.drives import FEED_DRIVE, PAPER, lag

LAG = replace(PAPER, actuator=lag(0.7))
SLOW = replace(FEED_DRIVE, actuator=lag(0.004))


def lagged(motion: Motion) -> float:
    """The force that the actuator exerts, N, without the disturbance."""
    return motion.applied_force - motion.disturbance


def test_through_slip_the_motion_is_the_exact_solution() -> None:
    """Coulomb friction is constant in slip: the drive and its lag are linear."""
    drive = replace(PAPER, friction=Coulomb(0.1), belt_speed=5.0, actuator=lag(0.7))
    motion = Motion(drive, 0.2, 0.0)
    # x, y, u and 1; friction drives the slide forward.
    state = np.array([0.2, 0.0, 0.0, 1.0])
    for command, disturbance, duration in ((0.5, 0.0, 1.3), (-0.8, 0.3, 0.4), (0.2, -0.1, 2.0)):
        motion.set_forces(command, disturbance)
        rates = np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-1.0, -0.02, 1.0, 0.1 + disturbance],
                [0.0, 0.0, -1.0 / 0.7, command / 0.7],
                [0.0, 0.0, 0.0, 0.0],
            ]
        )
        state = expm(rates * duration) @ state
        motion.advance(duration)
        found = motion.position, motion.velocity, lagged(motion)
        assert found == pytest.approx(state[:3], abs=1e-13)
        assert motion.applied_force == pytest.approx(state[2] + disturbance, abs=1e-13)


def test_it_breaks_loose_at_the_instant_at_which_the_lag_reaches_the_limit() -> None:
    """Stuck on a belt at rest, with u = command (1 - exp(-t/tau)) against friction."""
    drive = replace(LAG, belt_speed=0.0)
    motion = RecordedMotion(drive, 0.0, 0.0)
    motion.set_forces(1.0, -0.1)
    motion.advance(1.0)
    times = motion.take_breakpoints().time
    release = brentq(lambda t: 1.0 - exp(-t / 0.7) - 0.1 - 0.4, 0.0, 1.0, xtol=1e-15)
    assert np.min(np.abs(times - release)) < 1e-13
    assert not motion.sticking
    assert motion.velocity > 0.0


def test_a_disturbance_does_not_lag() -> None:
    motion = Motion(LAG, 0.0, 0.0)
    motion.set_forces(0.0, 0.3)
    assert motion.applied_force == pytest.approx(0.3)
    motion.set_forces(0.5, 0.3)
    assert motion.applied_force == pytest.approx(0.3)
    assert (motion.force, motion.disturbance) == pytest.approx((0.5, 0.3))
    motion.force = 0.7
    assert (motion.force, motion.disturbance) == pytest.approx((0.7, 0.3))
    motion.advance(0.7)
    assert motion.applied_force == pytest.approx(0.3 + 0.7 * (1.0 - exp(-1.0)), rel=1e-13)


CHANGES = {
    "scales": {"mass": 250.0, "stiffness": 3e6, "normal_force": 2000.0},
    "belt and friction": {"belt_speed": -0.01, "friction": Stribeck(0.3, 0.2, 0.07)},
    "lag": {"actuator": lag(0.02)},
    "signals": {"belt": ramp(0.01, duration=0.5)},
    "memory": {"friction": Dahl(0.4, bristle_stiffness=2e5)},
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_a_change_of_drive_keeps_lag_and_held_forces(change: dict[str, object]) -> None:
    motion = Motion(SLOW, 0.0, 0.0)
    motion.set_forces(200.0, -30.0)
    motion.advance(0.003)
    exerted = lagged(motion)
    assert 50.0 < exerted < 150.0
    motion.drive = replace(SLOW, **change)  # type: ignore[arg-type]
    assert (motion.force, motion.disturbance) == pytest.approx((200.0, -30.0), rel=1e-13)
    assert lagged(motion) == pytest.approx(exerted, rel=1e-13)
    tau = motion.drive.actuator.time_constant
    motion.advance(0.002)
    left = (200.0 - exerted) * exp(-0.002 / tau)
    assert lagged(motion) == pytest.approx(200.0 - left, rel=1e-11)


def test_a_lag_may_come_and_go() -> None:
    motion = Motion(FEED_DRIVE, 0.0, 0.0)
    motion.set_forces(100.0, 20.0)
    assert (motion.force, motion.disturbance) == (120.0, 0.0)
    motion.drive = SLOW
    assert motion.applied_force == 0.0
    motion.set_forces(100.0, 20.0)
    motion.advance(0.1)
    assert motion.applied_force == pytest.approx(120.0, rel=1e-9)
    motion.drive = FEED_DRIVE
    assert motion.applied_force == pytest.approx(120.0, rel=1e-12)
    motion.set_forces(50.0, 0.0)
    assert motion.applied_force == pytest.approx(50.0, rel=1e-12)


def test_friction_is_that_under_the_lagged_force() -> None:
    motion = Motion(replace(LAG, belt_speed=0.0), 0.05, 0.0)
    motion.set_forces(0.2, 0.1)
    motion.advance(0.7)
    assert motion.sticking
    force = 0.2 * (1.0 - exp(-1.0)) + 0.1
    assert motion.friction_force == pytest.approx(0.05 - force, rel=1e-12)
