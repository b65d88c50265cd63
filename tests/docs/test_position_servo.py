"""examples/position_servo.py: the forces are those of the published controller."""

import sys
from collections.abc import Iterator
from importlib import import_module
from types import ModuleType

import numpy as np
import pytest

from stickslip_ros.motion.controller import Controller
from stickslip_ros.samples import Sample
from tests.docs.page import CHECKOUT

GTAU, KP, KV = 35.15065, 160.18, 243.45
"""N/V, 1/s and V/(m/s), as published."""


@pytest.fixture(scope="module")
def example() -> Iterator[ModuleType]:
    sys.path.insert(0, str(CHECKOUT / "examples"))
    yield import_module("position_servo")
    sys.path.remove(str(CHECKOUT / "examples"))
    del sys.modules["position_servo"]


def test_the_axis_follows_its_reference_with_the_published_forces(example: ModuleType) -> None:
    moved, reference = example.simulate(example.PositionServo(force_limit=example.FORCE_LIMIT))
    voltage = np.clip(KV * (KP * (reference - moved.position) - moved.velocity), -10.0, 10.0)
    assert moved.control_force == pytest.approx(GTAU * voltage, rel=1e-6, abs=1e-6)
    clipped = np.abs(moved.control_force) == example.FORCE_LIMIT
    assert 0.01 < np.mean(clipped) < 0.2
    error = reference - moved.position
    assert np.sqrt(np.mean(error**2)) < 0.6e-3  # m
    moving = (moved.time > 0.6) & (moved.time < 1.1)
    # At a constant speed v the velocity loop needs v and the friction force: a lag of both.
    drive, speed = example.AXIS, 0.1  # m/s
    lag = (speed + (drive.damping * speed + 20.4) / (GTAU * KV)) / KP
    assert error[moving] == pytest.approx(lag, rel=1e-3)
    assert abs(error[-1]) < 20.4 / (GTAU * KV * KP)  # friction holds it there
    free, _ = example.simulate(example.PositionServo())  # without the limit
    assert np.max(np.abs(free.control_force)) > 1.5 * np.max(np.abs(moved.control_force))
    assert np.max(np.abs(reference - free.position)) < np.max(np.abs(error))


def test_without_a_reference_it_is_a_brake(example: ModuleType) -> None:
    controller = Controller(example.PositionServo())
    force = controller.answer(Sample(0, 0.5, 0.01, 0.0, 0.0, 0.0))
    assert force == pytest.approx(-GTAU * KV * 0.01, rel=1e-6)
