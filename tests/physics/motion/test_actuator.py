"""Drives whose actuator has a lag: the force follows the command, and is a part of the motion."""

from dataclasses import replace
from itertools import pairwise
from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Coulomb, Stribeck
from stickslip_ros.physics.motion import Motion, RecordedMotion
from stickslip_ros.physics.motion.variational import SensitiveMotion
from tests.examples import examples
from tests.physics.actuators import lag
from tests.physics.drives import FEED_DRIVE, PAPER
from tests.physics.parts import Dahl, Ramp

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


def phase_by_scipy(
    drive: Drive, sign: float, state: FloatArray, forces: tuple[float, float], duration: float
) -> tuple[FloatArray, float, float]:
    """State and time at the end of a phase, and the sign of the next one, 0 for stick.

    The state is position, velocity and lagged force; the forces are command and disturbance.
    """
    command, disturbance = forces
    time_constant = drive.actuator.time_constant
    belt, normal = drive.belt_speed, drive.normal_force
    limit = normal * float(drive.friction.static)

    def needed(state: FloatArray) -> float:
        x, y, u = state
        return float(drive.stiffness * x + drive.damping * y - u - disturbance)

    if sign == 0.0 and abs(needed(state)) >= limit:
        sign = -float(np.sign(needed(state)))

    def rates(_: float, state: FloatArray) -> list[float]:
        lagging = (command - state[2]) / time_constant
        if sign == 0.0:
            return [belt, 0.0, lagging]
        friction = normal * float(drive.friction.coefficient(state[1] - belt, sign))
        return [state[1], (friction - needed(state)) / drive.mass, lagging]

    def margin(time: float, state: FloatArray) -> float:
        if sign == 0.0:
            return (limit - abs(needed(state))) / normal
        if time < 1e-5 * drive.natural_period:  # a slip that starts on the margin
            return 1.0
        return sign * (float(state[1]) - belt) / drive.speed_scale

    margin.terminal, margin.direction = True, -1.0  # type: ignore[attr-defined]
    scales = [drive.length_scale, drive.speed_scale, normal]
    found = solve_ivp(
        rates, (0.0, duration), state, method="DOP853", events=margin,
        rtol=1e-12, atol=np.multiply(1e-13, scales), max_step=0.01 * drive.natural_period,
    )  # fmt: skip
    end = found.y[:, -1]
    if found.status == 1 and sign != 0.0:
        end[1] = belt
        sign = 0.0 if abs(needed(end)) < limit else -float(np.sign(needed(end)))
    elif found.status == 1:
        sign = -float(np.sign(needed(end)))
    return end, float(found.t[-1]), sign


@pytest.mark.parametrize(
    "drive",
    [
        replace(LAG, damping=0.4),
        replace(FEED_DRIVE, damping=4000.0, actuator=lag(0.007)),
    ],
    ids=["paper", "feed_drive"],
)
def test_through_stick_and_slip_it_is_that_of_another_integrator(drive: Drive) -> None:
    """A held slide breaks loose by the force that lags, slips, and sticks again."""
    time, normal = 1.0 / drive.angular_frequency, drive.normal_force
    motion = Motion(drive, 0.0, drive.belt_speed)
    state, sign = np.array([0.0, drive.belt_speed, 0.0]), 0.0
    scales = np.array([drive.length_scale, drive.speed_scale, normal])
    signs = [sign]
    for command, disturbance, duration in (
        (-0.5, 0.0, 0.4),
        (-0.5, 0.1, 3.0),
        (0.9, 0.1, 2.0),
        (0.2, -0.2, 5.0),
        (-0.3, 0.0, 5.0),
    ):
        motion.set_forces(command * normal, disturbance * normal)
        motion.advance(duration * time)
        left = duration * time
        while left > 1e-12 * time:
            forces = command * normal, disturbance * normal
            state, elapsed, sign = phase_by_scipy(drive, sign, state, forces, left)
            left -= elapsed
            signs += [sign] if sign != signs[-1] else []
        found = np.array([motion.position, motion.velocity, lagged(motion)])
        np.testing.assert_allclose(found / scales, state / scales, atol=1e-9)
        assert motion.sticking == (sign == 0.0)
    assert signs == [0.0, -1.0, 1.0, 0.0, -1.0]


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


def test_friction_is_that_under_the_lagged_force() -> None:
    motion = Motion(replace(LAG, belt_speed=0.0), 0.05, 0.0)
    motion.set_forces(0.2, 0.1)
    motion.advance(0.7)
    assert motion.sticking
    force = 0.2 * (1.0 - exp(-1.0)) + 0.1
    assert motion.friction_force == pytest.approx(0.05 - force, rel=1e-12)


CHANGES = {
    "mass": {"mass": 250.0},
    "stiffness": {"stiffness": 3e6},
    "normal force": {"normal_force": 2000.0},
    "belt": {"belt_speed": -0.01},
    "friction": {"friction": Stribeck(0.3, 0.2, 0.07)},
    "lag": {"actuator": lag(0.02)},
    "courses": {"belt": Ramp(0.01, 0.0, 0.5)},
    "memory": {"friction": Dahl(0.4, bristle=2e5)},
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


@pytest.mark.parametrize("drive", [FEED_DRIVE, replace(FEED_DRIVE, belt=Ramp(0.01, 0.0, 0.5))])
def test_drives_with_and_without_lag_of_one_class_do_not_share_equations(drive: Drive) -> None:
    ends: list[float] = []
    for actuator in (
        lag(0.0),
        lag(0.004),
        lag(0.0),
    ):
        motion = Motion(replace(drive, actuator=actuator), 0.0, 0.0)
        motion.set_forces(100.0, 0.0)
        motion.advance(0.02)
        ends.append(motion.position)
    ideal = Motion(drive, 0.0, 0.0)
    ideal.set_forces(100.0, 0.0)
    ideal.advance(0.02)
    assert ends[0] == ends[2] == ideal.position
    assert abs(ends[1] - ends[0]) > 1e-6


def test_restart_puts_the_lag_at_rest_and_keeps_the_held_forces() -> None:
    motion, fresh = Motion(LAG, 0.0, 0.0), Motion(LAG, 0.3, -0.1)
    for each in (motion, fresh):
        each.set_forces(0.5, -0.1)
    motion.advance(3.0)
    motion.restart(0.3, -0.1)
    assert lagged(motion) == 0.0
    motion.advance(2.0)
    fresh.advance(2.0)
    assert (motion.position, motion.velocity) == (fresh.position, fresh.velocity)


@given(
    st.sampled_from([0.05, 0.7, 5.0]),
    st.floats(-0.4, 0.4),
    st.floats(-1.0, 1.0),
    st.lists(st.floats(0.0, 1.0), max_size=4),
)
@examples(quick=20, thorough=200)
def test_cutting_a_motion_anywhere_changes_nothing(
    time_constant: float, belt_speed: float, command: float, cuts: list[float]
) -> None:
    drive = replace(PAPER, belt_speed=belt_speed, actuator=lag(time_constant))
    whole, cut, recorded = (kind(drive, 0.1, 0.2) for kind in (Motion, Motion, RecordedMotion))
    for motion in (whole, cut, recorded):
        motion.set_forces(command, 0.05)
    whole.advance(8.0)
    recorded.advance(8.0)
    ends = [0.0, *sorted(8.0 * share for share in cuts), 8.0]
    for before, after in pairwise(ends):
        cut.advance(after - before)
    for motion in (cut, recorded):
        found = motion.position, motion.velocity, motion.applied_force
        wanted = whole.position, whole.velocity, whole.applied_force
        assert found == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("law", [PAPER.friction, Dahl(0.4)], ids=["stribeck", "dahl"])
@pytest.mark.parametrize("duration", [0.5, 2.0, 7.0])
def test_transition_is_that_of_finite_differences(law: object, duration: float) -> None:
    """The derivatives jump where the slide sticks, and where the lagged force releases it."""
    motion = SensitiveMotion(replace(PAPER, friction=law))  # type: ignore[arg-type]
    motion.drive = replace(motion.drive, actuator=LAG.actuator)
    motion.set_forces(-0.3, 0.1)
    start = np.array([0.1, 0.1, *([0.001] * (motion.order - 3)), 0.5])

    def end(state: FloatArray) -> FloatArray:
        motion.start(state)
        motion.advance(duration)
        return motion.state

    columns = [(end(start + h) - end(start - h)) / 2e-6 for h in 1e-6 * np.eye(motion.order)]
    end(start)
    np.testing.assert_allclose(motion.transition, np.transpose(columns), rtol=1e-5, atol=1e-7)
