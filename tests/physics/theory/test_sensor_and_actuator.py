"""The sampled loop with a lag of the actuator and a difference for the velocity."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from stickslip_ros.physics.loop.controller import Controller, answer
from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.model.actuator import Actuator
from stickslip_ros.physics.model.control import VelocityFeedback, Washout
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Exponential, LuGre
from stickslip_ros.physics.model.sensor import MeasuredVelocity, Sensor
from stickslip_ros.physics.motion import Motion
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop
from tests.physics.drives import FEED_DRIVE

LUGRE = replace(FEED_DRIVE, friction=LuGre(Exponential(0.4, 0.25, 0.02), 1e5, 100.0))
LAWS = (Washout(20.0, -3000.0, 0.0), VelocityFeedback(-2500.0))
SAMPLES = 60
ROUGH = {"position_resolution": 1e-6, "position_noise": 1e-6}


def sensor(spans: int, **others: Any) -> Sensor:
    if spans == 0:
        return Sensor(**others)
    return Sensor(velocity=MeasuredVelocity.DIFFERENCE, difference_samples=spans, **others)


def linear_loop(drive: Drive, delay: float, spans: int) -> LinearSampledLoop:
    loop = LinearSampledLoop.from_drive(drive, 1000.0, delay, sensor(spans))
    assert loop is not None
    return loop


def response(drive: Drive, law: Any, delay: float, spans: int) -> np.ndarray:
    """Displacement after a unit force of one period, by a central difference of the loop itself."""
    ends: list[list[float]] = []
    force = 1e-6 * drive.normal_force
    for sign in (1.0, -1.0):
        motion = Motion(drive, drive.equilibrium_position, 0.0)
        memory = drive.friction.memory_at(-drive.belt_speed, -1.0)
        motion.restart(drive.equilibrium_position, 0.0, memory)
        options = {"force_delay": delay, "sensor": sensor(spans)}
        loop = SampledLoop(motion, 1000.0, 0, **options)  # type: ignore[arg-type]
        controller, found = Controller(law), list[float]()
        for number in range(SAMPLES + 20):
            answer(loop, controller)
            loop.disturb(sign * force if number == 18 else 0.0)
            loop.advance()
            if number >= 19:
                found.append(loop.true_sample.position)
        ends.append(found)
    return np.subtract(*ends) / (2.0 * force)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("drive", [FEED_DRIVE, LUGRE], ids=["static", "memory"])
@pytest.mark.parametrize(
    ("delay", "lag", "spans"),
    [(0.0, 0.0, 3), (0.4e-3, 1e-3, 1), (2.7e-3, 5e-3, 0), (0.4e-3, 0.0, 0), (2.7e-3, 1e-3, 3)],
)
def test_the_matrix_is_that_of_the_loop(
    law: Any, drive: Drive, delay: float, lag: float, spans: int
) -> None:
    drive = replace(drive, actuator=Actuator(time_constant=lag))
    loop = linear_loop(drive, delay, spans)
    matrix = loop.transition_matrix(law)
    open_loop, _ = loop.plant
    order = len(open_loop)
    pushed = np.zeros((order + 1, order + 1))
    pushed[:order, :order], pushed[1, order] = open_loop, 1.0
    state = np.zeros(len(matrix))
    state[:order] = expm(pushed * loop.period)[:order, order]
    predicted = []
    for _ in range(SAMPLES + 1):
        predicted.append(state[0] * drive.length_scale / drive.normal_force)
        state = matrix @ state
    found = response(drive, law, delay, spans)
    assert found == pytest.approx(predicted, abs=1e-6 * np.abs(predicted).max())


@pytest.mark.parametrize("drive", [FEED_DRIVE, LUGRE], ids=["static", "memory"])
@pytest.mark.parametrize(
    ("delay", "lag", "spans"),
    [(0.0, 0.0, 8), (0.4e-3, 1e-3, 2), (2.7e-3, 1e-3, 3), (2.7e-3, 0.0, 1), (0.0, 1e-3, 0)],
)
def test_the_stable_gains(drive: Drive, delay: float, lag: float, spans: int) -> None:
    """Against the eigenvalues at very many gains."""
    loop = linear_loop(replace(drive, actuator=Actuator(time_constant=lag)), delay, spans)
    intervals = loop.stable_linear_gains(20.0)
    scale = max([5000.0, *(abs(end) for interval in intervals for end in interval)])
    gains = np.linspace(-1.47 * scale, 1.43 * scale, 601)
    rates = loop.decay_rates(np.array([20.0]), gains)[0]
    inside = np.any([(low < gains) & (gains < high) for low, high in intervals], axis=0)
    assert np.array_equal(rates > 0.0, np.broadcast_to(inside, rates.shape))
    for end in (end for interval in intervals for end in interval):
        around = [loop.spectral_radius(Washout(20.0, end * g, 0.0)) for g in (0.999999, 1.000001)]
        assert min(around) < 1.0 < max(around)


def test_what_is_not_linear_is_left_out() -> None:
    limited = replace(FEED_DRIVE, actuator=Actuator(limit=10.0, resolution=1.0))
    rough = LinearSampledLoop.from_drive(limited, 1000.0, 0.0, sensor(2, **ROUGH))
    smooth = linear_loop(FEED_DRIVE, 0.0, 2)
    assert rough is not None
    assert np.array_equal(rough.transition_matrix(LAWS[0]), smooth.transition_matrix(LAWS[0]))
