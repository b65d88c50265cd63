"""Theory of a drive behind a motor: against the running loop, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.model.control import Cascade, ControlLaw, VelocityFeedback, Washout
from stickslip_ros.model.friction import Linear
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.sensor import MeasuredVelocity, Sensor
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.controller import Controller, answer
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycle_of_run, limit_cycles
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.theory.requirements import NotCoveredError
from stickslip_ros.theory.shooting import shoot
from stickslip_ros.theory.sticking import sticking_onset
from tests.drives import FEED_DRIVE, settled

MOTOR = Motor(mass=100.0, damping=10.0, friction=50.0)
DRIVE = replace(FEED_DRIVE, motor=MOTOR, guide_damping=20.0)
CASCADE = Cascade(20.0, 6000.0, 6e4, feedback="motor", velocity_feedback="motor")
HOLDING = VelocityFeedback(velocity_gain=-2000.0, position_gain=-2e5, feedback="motor")


@pytest.mark.parametrize("law", [None, Washout(20.0, -3e3, 0.0), VelocityFeedback(-3e3)])
def test_without_a_position_loop_there_is_no_equilibrium(law: ControlLaw | None) -> None:
    control = None if law is None else law.continuous
    for compute in (expand, hopf_points):
        with pytest.raises(NotCoveredError, match=r"the guide drags it off.*no equilibrium"):
            compute(DRIVE, control)
    if law is not None:
        loop = LinearSampledLoop.from_drive(DRIVE, 1000.0)
        assert loop is not None
        with pytest.raises(NotCoveredError, match=f"with {law.name} nothing holds the motor"):
            loop.spectral_radius(law)
    motion = Motion(DRIVE, 0.0, 0.0, control)
    motion.advance(60.0)
    assert motion.motor is not None
    assert motion.motor.velocity == pytest.approx(DRIVE.belt_speed, rel=1e-6)


def test_what_needs_an_ideal_motor_says_so() -> None:
    for refused in (sticking_onset, limit_cycles):
        with pytest.raises(NotCoveredError, match="needs an ideal motor: the motor of the drive"):
            refused(DRIVE)


@pytest.mark.parametrize(("spans", "delay"), [(0, 0.0), (2, 1.3e-3)])
@pytest.mark.parametrize(
    "law",
    [
        replace(CASCADE, linear_gain=-800.0),
        pytest.param(
            replace(CASCADE, integral_gain=0.0, feedback="table", washout_feedback="motor"),
            marks=pytest.mark.long,
        ),
        HOLDING,
    ],
    ids=["motor", "table", "feedback"],
)
def test_the_sampled_loop_moves_as_its_matrix_says(
    law: Cascade | VelocityFeedback, spans: int, delay: float
) -> None:
    """Friction is linear while it slips: two runs differ by powers of the matrix."""
    drive = replace(DRIVE, friction=Linear(static=0.3, slope=0.5), motor=Motor(100.0, 10.0))
    sensor = Sensor()
    if spans:
        sensor = Sensor(velocity=MeasuredVelocity.DIFFERENCE, difference_samples=spans)
    period, found = 1e-3, []
    at_rest = expand(drive, law)
    assert at_rest is not None
    rest = at_rest.equilibrium
    force = float(rest[2]) * drive.normal_force
    start = (force, 0.0, 0.0, 0.0) if isinstance(law, Cascade) else None
    x, far = (rest[[0, -2]] * drive.length_scale).tolist()
    for offset in (0.0, 1e-6):
        motion = Motion(drive, 0.0, 0.0)
        motion.restart(x + 1e-5 + offset, 0.0, motor=(far, 0.0))
        loop = SampledLoop(
            motion,
            1.0 / period,
            1_000_000_000,
            force_delay=delay,
            sensor=sensor,
            motor_sensor=sensor,
        )
        controller, states = Controller(law, state=start), []
        for _ in range(60):
            assert motion.motor is not None
            states.append([motion.position, motion.velocity, *motion.motor])
            answer(loop, controller)
            loop.advance()
        found.append(states)
    linear = LinearSampledLoop.from_drive(drive, 1.0 / period, delay, sensor, sensor)
    assert linear is not None
    matrix = linear.transition_matrix(law)
    scale = [1.0, drive.angular_frequency, 1.0, drive.angular_frequency]
    difference = np.subtract(*found[::-1])
    powers = [np.eye(len(matrix))]
    for _ in range(59):
        powers.append(powers[-1] @ matrix)
    outputs = np.stack(powers)[:, :4]
    state = 1e-6 * powers[0][0]
    if spans:  # what the sensors have seen before the start follows from all samples
        state = np.linalg.lstsq(np.vstack(outputs), (difference / scale).ravel())[0]
    error = np.abs(difference - outputs @ state * scale) / np.abs(difference).max(axis=0)
    assert error.max() < 1e-6


@pytest.mark.long
def test_a_hopf_point_is_where_small_deviations_begin_to_grow() -> None:
    (point,) = hopf_points(DRIVE, CASCADE)
    for share, grows in ((0.95, True), (1.05, False)):
        drive = replace(DRIVE, belt_speed=share * point.belt_speed)
        expansion = expand(drive, CASCADE)
        assert expansion is not None
        assert expansion.stable is not grows
        rest = float(expansion.equilibrium[0]) * drive.length_scale
        motion = Motion(drive, 1.001 * rest, 0.0, CASCADE)
        motion.control_state = (float(expansion.equilibrium[2]) * drive.normal_force, 0.0)
        peaks = []
        for _ in range(2):
            highest = 0.0
            for _ in range(600):
                motion.advance(1e-3)
                highest = max(highest, abs(motion.position - rest))
            peaks.append(highest)
            motion.advance(2.0)
        assert (peaks[1] > peaks[0]) is grows


@pytest.mark.long
def test_the_cycle_of_a_run_is_that_of_the_motion_and_its_multiplier_the_decay() -> None:
    drive = replace(DRIVE, belt_speed=0.01)
    cycle = limit_cycle_of_run(drive, 0.0, control=CASCADE)
    assert cycle is not None
    assert cycle.stable
    assert cycle.motor is not None
    measures = settled(RecordedMotion(drive, 0.0, 0.0, CASCADE), 1500, 100)
    assert measures.amplitude == pytest.approx(cycle.measures.amplitude, rel=1e-6)
    assert measures.period == pytest.approx(cycle.period, rel=1e-6)
    again = shoot(
        drive, cycle.position, cycle.period, control=CASCADE,
        filter_state=cycle.filter_states, motor=cycle.motor,
    )  # fmt: skip
    assert again is not None
    np.testing.assert_allclose(again.multipliers, cycle.multipliers, atol=1e-6)
