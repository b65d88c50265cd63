"""The frequency response of the sampled loop against its matrices and the running loop."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.control import (
    Cascade,
    ControlLaw,
    DisturbanceObserver,
    Pid,
    Reference,
    VelocityFeedback,
    Washout,
)
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Stribeck
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.sensor import EXACT_SENSOR, MeasuredVelocity, Sensor
from stickslip_ros.model.signals import step
from stickslip_ros.motion import Motion
from stickslip_ros.motion.controller import Controller, answer
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.theory.loop_response import LoopResponse, PlantResponse

DRIVE = Drive(100.0, 200.0, 1e6, 1000.0, 0.03, Stribeck(0.4, 0.25, 0.05))
RATE = 1000.0
DIFFERENCE = Sensor(velocity=MeasuredVelocity.DIFFERENCE, difference_samples=2)
LAWS = [
    Washout(20.0, linear_gain=-6000.0, cubic_gain=0.0),
    VelocityFeedback(velocity_gain=-6000.0),
    Pid(position_gain=2e5, integral_gain=3e6, velocity_gain=6e3),
    Cascade(position_gain=30.0, velocity_gain=6e3, integral_gain=1e5),
    DisturbanceObserver(nominal_mass=80.0, bandwidth=50.0, position_gain=1e5, velocity_gain=3e3),
]
laws = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)


def loop_of(
    sensor: Sensor = EXACT_SENSOR, drive: Drive = DRIVE, motor_sensor: Sensor = EXACT_SENSOR
) -> LinearSampledLoop:
    loop = LinearSampledLoop.from_drive(drive, RATE, 1.3e-3, sensor, motor_sensor)
    assert loop is not None
    return loop


def response_of(loop: LinearSampledLoop, law: ControlLaw) -> LoopResponse:
    feedback = law.linear_part(1.0 / loop.rate)
    assert feedback is not None
    (response,) = LoopResponse.of_plants([PlantResponse.of_loop(loop)], feedback)
    return response


@laws
@pytest.mark.parametrize("sensor", [EXACT_SENSOR, DIFFERENCE], ids=["exact", "difference"])
@pytest.mark.parametrize("motor", [None, Motor(50.0, 10.0)], ids=["ideal", "motor"])
def test_one_plus_the_loop_is_the_ratio_of_the_characteristic_polynomials(
    law: ControlLaw, sensor: Sensor, motor: Motor | None
) -> None:
    if motor is not None and not isinstance(law, Pid | Cascade | DisturbanceObserver):
        return  # it needs a position loop
    if motor is not None and isinstance(law, Cascade):
        law = replace(law, velocity_feedback="motor")
    drive = replace(DRIVE, motor=motor, actuator=Actuator(time_constant=1e-3))
    loop = loop_of(sensor, drive, sensor)
    found = response_of(loop, law)
    form = law.linear_feedback(1.0 / RATE)
    assert form is not None
    rows = slice(5, None, 97)
    z = np.exp(1j * found.plant.frequency[rows] / RATE)
    once, twice = (
        loop.transition_matrix(VelocityFeedback(0.0, position_gain=gain)) for gain in (1.0, 2.0)
    )

    def polynomial(matrix: FloatArray) -> np.ndarray:
        return np.linalg.det(z[:, None, None] * np.eye(len(matrix)) - matrix)

    expected = polynomial(loop.transition_matrix(law)) / (
        polynomial(2.0 * once - twice) * polynomial(form.state)
    )
    np.testing.assert_allclose(1.0 + found.open_loop[rows], expected, rtol=1e-7)


@laws
def test_margins_lead_to_the_limit_of_stability(law: ControlLaw) -> None:
    loop = loop_of()
    found = response_of(loop, law)
    assert found.delay_margin is not None
    later = replace(loop, force_delay=loop.force_delay + found.delay_margin)
    assert later.spectral_radius(law) == pytest.approx(1.0, abs=1e-3)
    gain = law.tuned[-1] if isinstance(law, Washout | VelocityFeedback) else None
    if gain is not None:
        for factor in found.gain_margins:
            assert factor is not None
            other = replace(law, **{gain: getattr(law, gain) * factor})
            assert loop.spectral_radius(other) == pytest.approx(1.0, abs=1e-4)
    assert found.phase_margin is not None
    assert 0.0 < found.phase_margin < pi


def running_forces(
    drive: Drive,
    law: ControlLaw,
    count: int,
    size: float = 0.0,
    noises: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """The forces of a running loop with a step at 0.01 s, and noise of slide and motor."""
    rest = drive.equilibrium_position
    own, motor = (replace(DIFFERENCE, position_noise=noise) for noise in noises)
    running = SampledLoop(
        Motion(drive, rest, 0.0),
        RATE,
        10**9,
        force_delay=1.3e-3,
        sensor=own,
        motor_sensor=motor,
        disturbance=step(size, 0.01, 1e9),
    )
    controller = Controller(law, lambda time: Reference(rest, 0.0, 0.0))
    result: list[float] = []
    for _ in range(count):
        result.append(answer(running, controller))
        running.advance()
    return np.array(result)


@laws
def test_the_force_after_a_step_and_by_noise_is_that_of_the_running_loop(law: ControlLaw) -> None:
    found, small = response_of(loop_of(DIFFERENCE), law), 1e-3
    later, before = (running_forces(DRIVE, law, 210, size) for size in (small, -small))
    by_step = (later - before)[10:] / (2.0 * small)
    size = np.abs(by_step).max()
    np.testing.assert_allclose(found.step_response()[:200], by_step, rtol=0.0, atol=1e-3 * size)
    by_noise = running_forces(DRIVE, law, 4000, noises=(1e-9, 0.0))[1000:].std()
    assert found.noise_force(1e-9) == pytest.approx(by_noise, rel=0.1)


def test_the_noise_of_a_motor_enters_the_force() -> None:
    drive = replace(DRIVE, motor=Motor(50.0, 10.0))
    law = Cascade(position_gain=20.0, velocity_gain=4e3, velocity_feedback="motor")
    found = response_of(loop_of(DIFFERENCE, drive, DIFFERENCE), law)
    noisy, exact = (running_forces(drive, law, 4000, noises=(0.0, n)) for n in (1e-9, 0.0))
    assert found.noise_force(0.0, 1e-9) == pytest.approx((noisy - exact)[1000:].std(), rel=0.1)
