"""Motions through a record."""

import numpy as np
import pytest

from stickslip_ros.identification.record import Record
from stickslip_ros.identification.trajectory import Predictor, free_run
from stickslip_ros.physics.model.friction import Coulomb
from tests.identification.axis_record import axis

_DRIVE = axis(Coulomb(static=20.0, viscous=200.0))


def _moved(velocity: float) -> Record:
    """Return a run of an axis that a force moves to and fro."""
    time = 1e-3 * np.arange(4000)
    force = 60.0 * np.sin(9.0 * time) + 40.0 * np.sin(31.0 * time)
    still = Record("axis", 1e-3, np.zeros(len(time)), np.zeros(len(time)), force=force)
    position = Predictor(still).positions(_DRIVE, velocity)
    return Record("axis", 1e-3, np.rint(position / 1e-6) * 1e-6, still.belt_velocity, force=force)


def test_no_velocity_at_the_start_near_the_found_one_is_better() -> None:
    velocity = 0.35
    record = _moved(velocity)
    found, positions = free_run(record, _DRIVE)
    assert found == pytest.approx(velocity, rel=0.05)
    error = np.std(positions - record.position)
    for share in (-0.05, -0.01, 0.01, 0.05):
        speed = (1.0 + share) * found
        other = Predictor(record).positions(_DRIVE, speed)
        assert error < 1.05 * np.std(other - record.position)
