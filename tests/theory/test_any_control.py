"""Theory under continuous control of any kind: feedback of the state, and laws with states."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.model.control import Cascade, VelocityFeedback
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion.variational import ShootingMotion
from stickslip_ros.theory.critical_gains import critical_gains, limit_cycle_from_hopf
from stickslip_ros.theory.cycle_bounds import least_cycle
from stickslip_ros.theory.hopf import HopfPoint, hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycle_of_run, limit_cycles
from stickslip_ros.theory.linear import expand, jacobians
from tests.drives import FEED_DRIVE, PAPER

GAINS = [
    (PAPER, VelocityFeedback(-0.1, 0.0)),
    (PAPER, VelocityFeedback(-0.5, 0.0)),
    (PAPER, VelocityFeedback(0.3, 0.0)),
    (PAPER, VelocityFeedback(-0.1, -0.7)),
    (PAPER, VelocityFeedback(0.002, 0.97)),
    (FEED_DRIVE, VelocityFeedback(-1000.0, -3e5)),
    (replace(FEED_DRIVE, belt_speed=-0.02), VelocityFeedback(-500.0, 4e5)),
]
feedback = pytest.mark.parametrize(("drive", "gains"), GAINS)


def altered(drive: Drive, gains: VelocityFeedback) -> Drive:
    """The drive whose spring and damper do what the feedback does."""
    return replace(
        drive,
        stiffness=drive.stiffness - gains.position_gain,
        damping=drive.damping - gains.velocity_gain,
    )


def in_si(drive: Drive, points: list[HopfPoint]) -> np.ndarray:
    return np.array(
        [
            (
                point.belt_speed,
                point.angular_frequency,
                point.crossing_speed,
                point.first_lyapunov_coefficient * drive.angular_frequency / drive.speed_scale**2,
            )
            for point in points
        ]
    )


@feedback
def test_feedback_of_the_state_is_a_spring_and_a_damper(
    drive: Drive, gains: VelocityFeedback
) -> None:
    other = altered(drive, gains)
    found, expected = expand(drive, gains), expand(other)
    position = found.equilibrium[0] * drive.length_scale
    assert position == pytest.approx(other.equilibrium_position, rel=1e-13)
    assert found.eigenvalues * drive.angular_frequency == pytest.approx(
        expected.eigenvalues * other.angular_frequency, rel=1e-10
    )
    assert found.stable == expected.stable
    speeds = np.array([0.1, 0.4, 0.7]) * drive.speed_scale
    mine, theirs = (
        np.linalg.eigvals(jacobians(each, control, speeds / each.speed_scale)).sum(axis=-1).real
        * each.angular_frequency
        for each, control in ((drive, gains), (other, None))
    )
    assert mine == pytest.approx(theirs, rel=1e-10)
    points, others = in_si(drive, hopf_points(drive, gains)), in_si(other, hopf_points(other))
    assert points == pytest.approx(others, rel=1e-8)


@feedback
def test_its_limit_cycle_is_that_of_that_drive(drive: Drive, gains: VelocityFeedback) -> None:
    other = altered(drive, gains)
    found = limit_cycle_of_run(drive, 0.0, control=gains)
    expected = next((cycle for cycle in limit_cycles(other) if cycle.stable), None)
    assert (found is None) == (expected is None)
    if found is None or expected is None:
        return
    assert found.filter_states == ()
    assert found.filter_state is None
    assert found.period == pytest.approx(expected.period, rel=1e-9)
    assert found.position == pytest.approx(expected.position, rel=1e-8)
    assert found.measures.amplitude == pytest.approx(expected.measures.amplitude, rel=1e-9)
    assert found.measures.regime is expected.measures.regime
    assert found.multipliers == pytest.approx(expected.multipliers, abs=1e-8)


def test_enough_velocity_feedback_leaves_no_cycle() -> None:
    little = VelocityFeedback(-0.1, 0.0)
    assert least_cycle(PAPER, little) == least_cycle(altered(PAPER, little))
    assert least_cycle(PAPER, VelocityFeedback(-3.0, 0.0)) is None


def test_the_theory_of_gains_is_of_no_other_control() -> None:
    assert critical_gains(PAPER, VelocityFeedback(-0.1, 0.0)) is None
    assert limit_cycle_from_hopf(PAPER, VelocityFeedback(-0.1, 0.0)) is None


def test_a_cycle_with_two_states_closes() -> None:
    law = Cascade(0.1, 0.05, 0.02, corner_frequency=1.5, linear_gain=-0.1)
    cycle = limit_cycle_of_run(PAPER, 0.0, control=law)
    assert len(cycle.filter_states) == 2
    assert cycle.filter_state is None
    assert len(cycle.multipliers) == 3
    motion = ShootingMotion(PAPER, law)
    start = motion.state_at(cycle.position, cycle.filter_states)
    assert start[2:].tolist() == list(cycle.filter_states)
    motion.start(start)
    motion.advance(cycle.period)
    assert motion.state == pytest.approx(start, abs=1e-11)
