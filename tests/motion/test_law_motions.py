"""Every friction law, in each direction, against scipy's DOP853 with events of its own."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import dop853
from benchmarks.dop853 import Dop853Drive, Signal
from benchmarks.random_drives import sticks_of, without_short
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Coulomb,
    Exponential,
    FrictionLaw,
    Linear,
    Stiction,
    Stribeck,
    Table,
)
from stickslip_ros.motion import Motion, RecordedMotion
from tests.drives import PAPER

SAME = [
    (Stribeck(0.4, 0.25, 0.5), dop853.stribeck(0.4, 0.25, 0.5)),
    (Coulomb(0.4), dop853.coulomb(0.4, 0.0)),
    (Linear(0.4, 0.1), dop853.linear(0.4, 0.1)),
    (Exponential(0.4, 0.25, 0.3, 0.02), dop853.exponential(0.4, 0.25, 0.3, 0.02, 1.0)),
    (
        Table(((0.0, 0.4), (0.2, 0.3), (0.5, 0.25), (0.9, 0.33))),
        dop853.tabulated([0.0, 0.2, 0.5, 0.9], [0.4, 0.3, 0.25, 0.33]),
    ),
]


@pytest.mark.parametrize(("law", "curve"), SAME, ids=lambda part: getattr(part, "name", ""))
@pytest.mark.parametrize("belt", [0.3, -0.3])
def test_same_motion(law: FrictionLaw, curve: dop853.Curve, belt: float) -> None:
    """Through many phases, under forces that are held in turn."""
    starts, forces = [0.0, 9.0, 13.0, 18.0], [0.0, 0.5, -0.7, 0.1]
    levels = [dop853.level(*each) for each in zip([-np.inf, *starts[1:]], forces, strict=True)]
    belts = dop853.none().plus(belt)
    solver = Dop853Drive(1.0, 0.02, 1.0, curve, curve, belts, force=Signal(levels))
    times = np.array([*starts, 25.0])
    expected = solver.run(0.1, 0.9, times)
    motion = RecordedMotion(replace(PAPER, belt_speed=belt, friction=law), 0.1, 0.9)
    for number, force in enumerate(forces, start=1):
        motion.force = force
        motion.advance(times[number] - times[number - 1])
        assert motion.position == pytest.approx(expected.position[number], rel=0.0, abs=1e-9)
        assert motion.velocity == pytest.approx(expected.velocity[number], rel=0.0, abs=1e-9)
    found = without_short(sticks_of(motion.take_breakpoints()), 1e-9)
    assert len(expected.sticks) > 2
    assert np.array(found) == pytest.approx(np.array(expected.sticks), rel=0.0, abs=1e-9)


@pytest.mark.parametrize(
    "law",
    [Stribeck(0.0, 0.0, 0.5), Coulomb(0.0), Linear(0.0, 0.0), Exponential(0.0, 0.0, 0.5, 0.0)],
    ids=lambda law: law.name,
)
@pytest.mark.parametrize("belt_speed", [0.2, 0.0, -0.5])
def test_without_friction_it_passes_the_speed_of_the_belt_unmoved(
    law: FrictionLaw, belt_speed: float
) -> None:
    """A friction coefficient of zero is allowed: the slide vibrates freely."""
    drive = replace(PAPER, damping=0.0, belt_speed=belt_speed, friction=law)
    motion = RecordedMotion(drive, 1.0, 0.0)
    motion.advance(20.0)
    found = motion.position, motion.velocity
    assert found == pytest.approx((np.cos(20.0), -np.sin(20.0)), rel=1e-12)


def test_stick_slip_with_stiction_in_closed_form() -> None:
    """A sine about the kinetic deflection between sticks up to the static one."""
    drive = Drive(10.0, 0.0, 4000.0, 98.1, 0.01, Stiction(static=0.3, kinetic=0.2))
    rate, drop = np.sqrt(4000.0 / 10.0), 0.1 * 98.1 / 4000.0
    slip = (2.0 * np.pi - 2.0 * np.arctan(drop * rate / 0.01)) / rate
    motion = Motion(drive, 0.3 * 98.1 / 4000.0 - 1e-4, 0.01)
    for cycle in range(3):
        motion.advance(slip + (0.11 if cycle == 0 else 2.0 * drop / 0.01))
        assert motion.sticking
        assert motion.position == pytest.approx(0.1 * 98.1 / 4000.0 + 0.1 * 0.01, rel=1e-11)
    turning = RecordedMotion(drive, motion.position, 0.01)
    turning.advance(2.0)
    positions = turning.take_breakpoints().position
    amplitude = np.hypot(drop, 0.01 / rate)
    assert np.ptp(positions) == pytest.approx(2.0 * amplitude, rel=1e-11)


@pytest.mark.parametrize("width", [1e-3, 1e-5, 1e-9])
def test_pieces_of_a_table_may_be_narrow_or_far_from_the_scale_of_the_drive(width: float) -> None:
    """Rounding must not lead back and forth between two pieces."""
    forces = ((0.0, 400.0), (width, 399.0), (2.0 * width, 398.0), (0.05, 250.0), (0.08, 270.0))
    ends: list[tuple[float, float]] = []
    for normal_force in (1000.0, 1.0):
        drive = Drive(
            mass=100.0,
            damping=200.0,
            stiffness=1e6,
            normal_force=normal_force,
            belt_speed=0.03,
            friction=Table(tuple((speed, force / normal_force) for speed, force in forces)),
        )
        motion = Motion(drive, 0.0, 0.0)
        motion.advance(0.4)
        ends.append((motion.position, motion.velocity))
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)
