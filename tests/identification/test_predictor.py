"""Motions through records, or parts of them, with their forces and their belts."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import identification as study
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.record import Record
from stickslip_ros.model.drive import Drive, in_units_of
from stickslip_ros.model.friction import Coulomb
from stickslip_ros.motion.variational import VariationalMotion
from tests.identification.axis_record import axis


def test_a_part_of_a_record_moves_on_the_belt_of_that_part() -> None:
    """Its motion and its derivatives are those of a record of that part alone."""
    record = study.record("exponential", "ramp", seed=1, duration=0.8)
    drive = Drive(
        mass=study.MASS,
        damping=0.0,
        stiffness=study.STIFFNESS,
        normal_force=study.NORMAL_FORCE,
        belt_speed=0.0,
        friction=study.LAWS["exponential"],
    )
    parts = [slice(0, 150), slice(330, 500), slice(620, 800)]
    starts = np.array([[2e-4, 0.01], [3e-4, -0.02], [1e-4, 0.03]])
    scaled, options = in_units_of(drive, drive), (0.0, VariationalMotion)
    together = Predictor(record).followed(scaled, parts, starts, *options)
    for part, start, (outputs, by) in zip(parts, starts, together, strict=True):
        alone = Predictor(record.part(part.start, part.stop))
        whole = [slice(0, part.stop - part.start)]
        ((expected, derivatives),) = alone.followed(scaled, whole, start[np.newaxis], *options)
        assert outputs == pytest.approx(expected, rel=0.0, abs=1e-10 * np.ptp(expected))
        largest = np.abs(derivatives).max(axis=0)
        assert (np.abs(by - derivatives).max(axis=0) <= 1e-8 * largest).all()


def test_no_velocity_at_the_start_near_the_found_one_is_better() -> None:
    drive, velocity = axis(Coulomb(static=20.0, viscous=200.0)), 0.35
    time, still = 1e-3 * np.arange(4000), np.zeros(4000)
    force = 60.0 * np.sin(9.0 * time) + 40.0 * np.sin(31.0 * time)
    start = Record("axis", 1e-3, still, still, force=force)
    position = np.rint(Predictor(start).positions(drive, velocity) / 1e-6) * 1e-6
    moved = replace(start, position=position)
    found, positions = Predictor(moved).free_run(drive)
    assert found == pytest.approx(velocity, rel=0.05)
    error = np.std(positions - position)
    for share in (-0.05, -0.01, 0.01, 0.05):
        other = Predictor(moved).positions(drive, (1.0 + share) * found)
        assert error < 1.05 * np.std(other - position)
