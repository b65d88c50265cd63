"""Breakpoints that a motion marks, exactly, and changes of a motion under way."""

import gc
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Exponential
from stickslip_ros.motion import Motion, RecordedMotion
from tests.drives import FEED_DRIVE, PAPER

# On a fast belt Coulomb friction is constant: a free vibration about mu_s with amplitude 0.3.
FREE = replace(PAPER, damping=0.0, belt_speed=1.0, friction=Coulomb(0.4))


def test_turning_points_have_a_velocity_of_exactly_zero() -> None:
    motion = RecordedMotion(FREE, 0.7, 0.0)
    motion.advance(10.0)
    breakpoints = motion.take_breakpoints()
    turning = breakpoints[breakpoints.velocity == 0.0]
    assert np.unique(np.round(turning.time, 9)) == pytest.approx([0.0, pi, 2 * pi, 3 * pi])
    assert turning.time[-1] == pytest.approx(3.0 * pi, rel=1e-13)
    assert turning.position[-1] == pytest.approx(0.1, rel=1e-13)
    fastest = breakpoints[np.abs(np.abs(breakpoints.velocity) - 0.3) < 1e-13]
    assert fastest.time == pytest.approx([pi / 2, 3 * pi / 2, 5 * pi / 2], rel=1e-12)
    assert fastest.position == pytest.approx([0.4, 0.4, 0.4], rel=1e-12)
    assert len(motion.take_breakpoints()) == 0
    motion.recording = False
    motion.advance(10.0)
    assert len(motion.take_breakpoints()) == 0


def test_a_motion_records_nothing_of_one_that_had_its_integrator_before() -> None:
    gc.collect()  # a motion of another test that is in a cycle would give its integrator back late
    motion = RecordedMotion(PAPER, 0.0, 0.0)
    flow = motion.core.flow
    assert flow is not None
    flow.taylor.propagate_until(10.0)
    assert any(flow.marks)
    del motion
    assert RecordedMotion(PAPER, 0.0, 0.0).core.flow is flow
    assert not any(flow.marks)


def test_no_sampled_state_is_beyond_the_breakpoints() -> None:
    """Between neighbouring breakpoints displacement and speed have no extremes."""
    drive = replace(FEED_DRIVE, belt_speed=0.02)
    coarse = RecordedMotion(drive, 0.0, 0.0)
    coarse.advance(0.3)
    breakpoints = coarse.take_breakpoints()
    sampled = Motion(drive, 0.0, 0.0)
    slack, step = 1e-12, 0.001
    for number in range(1, round(0.3 / step)):
        sampled.advance(step)
        after = int(np.searchsorted(breakpoints.time, number * step))
        for value, column in (
            (sampled.position / drive.length_scale, breakpoints.position / drive.length_scale),
            (sampled.velocity / drive.speed_scale, breakpoints.velocity / drive.speed_scale),
        ):
            low, high = sorted(column[after - 1 : after + 1])
            assert low - slack <= value <= high + slack


def test_a_stick_begins_at_the_landing() -> None:
    motion = RecordedMotion(PAPER, 0.0, 0.0)
    for _ in range(1000):
        motion.advance(0.1)
    breakpoints = motion.take_breakpoints()
    starts = np.flatnonzero(breakpoints.stuck[1:] & ~breakpoints.stuck[:-1]) + 1
    assert len(starts) > 10
    assert not breakpoints.sticking[starts].any()
    assert breakpoints.velocity[breakpoints.stuck] == pytest.approx(PAPER.belt_speed, rel=1e-12)
    lengths = np.diff(breakpoints.time)[breakpoints.sticking[1:]].sum()
    ridden = np.diff(breakpoints.position)[breakpoints.sticking[1:]].sum()
    assert ridden == pytest.approx(PAPER.belt_speed * lengths)
    assert len(Breakpoints.empty().stuck) == 0


def test_from_then_on_it_moves_as_the_new_drive() -> None:
    """Mass, damping, stiffness, normal force, belt speed and law are other ones."""
    changed = Drive(10.0, 3.0, 2e5, 500.0, -0.1, Exponential(0.3, 0.2, 0.02, 0.0))
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


def test_restart_puts_the_filter_of_the_continuous_controller_to_rest() -> None:
    motion = Motion(FEED_DRIVE, 0.0, 0.0, Washout(20.0, -3000.0, 0.0))
    motion.advance(0.3)
    assert abs(motion.applied_force) > 1.0
    motion.restart(1e-4, -0.08)
    # It has let nothing through of the constant speed that it is taken to have seen.
    assert motion.applied_force == pytest.approx(0.0, abs=1e-2)
