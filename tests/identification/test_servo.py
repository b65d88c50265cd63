"""The loop that the controller of a record closes."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.identification.record import Record
from stickslip_ros.identification.servo import closed_loop
from stickslip_ros.physics.model.friction import Coulomb
from tests.identification.axis_record import SERVO, axis


def test_the_loop_has_the_belt_of_the_record() -> None:
    """A belt that starts to move takes the slide with it, against the controller."""
    still = np.zeros(2000)
    belt = np.where(np.arange(2000) < 1000, 0.0, 0.02)
    record = Record("axis", 1e-3, still, belt, reference=still)
    drive = axis(Coulomb(static=20.0))
    soft = replace(SERVO, position_gain=1e4, velocity_gain=1e3)
    _, force = closed_loop(record, drive, soft, 0.0)
    assert np.abs(force[:990]).max() < 1e-6
    assert force[-1] == pytest.approx(-20.0, rel=0.01)
