import numpy as np
import pytest
from scipy.linalg import expm

from stickslip_ros.model.control import LugreObserver
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Exponential, LuGre
from tests.model.control.answers import (
    BELT_SPEED,
    PID_AND_CURVE,
    answers,
    assert_same,
    random_record,
)

LAW = LugreObserver(
    **PID_AND_CURVE,
    exponent=2.0,
    bristle_stiffness=4e7,
    bristle_damping=1e4,
    observer_gain=3.0,
)


@pytest.mark.parametrize("seed", range(5))
def test_it_adds_the_friction_of_the_bristles_to_pid_control(seed: int) -> None:
    """With z' = v + k e - a z, and (z, 1) as a linear system over each time between samples."""
    record, z, friction = random_record(seed, scale=1e-6), 0.0, []
    for step, y, e in zip(record.elapsed, record.velocity, record.error, strict=True):
        v = y - BELT_SPEED
        a = 4e7 * abs(v) / (250.0 + 150.0 * np.exp(-((v / 0.02) ** 2)))
        z = (expm(step * np.array([[-a, v + 3.0 * e], [0.0, 0.0]])) @ [z, 1.0])[0]
        friction.append(4e7 * z + 1e4 * (v + 3.0 * e - a * z) + 150.0 * v)
    integral = 4e6 * np.cumsum(record.elapsed * record.error)
    pid = 3e5 * record.error + integral + 2e3 * record.rate
    expected = pid + np.array(friction) + 90.0 * record.reference[2]
    assert_same(answers(LAW, record), expected)


def test_it_takes_the_bristles_of_a_drive() -> None:
    curve = Exponential(0.4, kinetic=0.25, decay_speed=0.02)
    drive = Drive(90.0, 0.0, 1e6, 1000.0, 0.03, LuGre(curve, 2e4, 5.0))
    found = LAW.for_drive(drive)
    assert (found.bristle_stiffness, found.bristle_damping) == (2e7, 5e3)
    assert (found.static_force, found.kinetic_force) == (400.0, 250.0)
