"""Every friction law, in each direction, against scipy's DOP853 with events of its own."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import (
    Coulomb,
    Directional,
    Exponential,
    FrictionLaw,
    Linear,
    Stribeck,
    Table,
)
from stickslip_ros.physics.motion import Motion
from tests.physics.drives import PAPER
from tests.physics.motion.dop853 import Array
from tests.physics.motion.random_drives import (
    LAWS,
    RandomCourse,
    difference,
    random_drive,
    sticks_of,
)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("directional", [False, True], ids=["", "by direction"])
@pytest.mark.parametrize("law", LAWS)
def test_the_motion_is_that_of_an_independent_solver(
    law: str, seed: int, *, directional: bool
) -> None:
    """From rest, under a constant force; every other belt moves backward."""
    drive = random_drive(seed, law, directional=directional)
    draw = np.random.default_rng(seed)
    plain = drive.plain
    belt_speed = float(draw.uniform(0.1, 0.4)) * plain.speed_scale * (-1) ** seed
    force = float(draw.uniform(-0.3, 0.3)) * plain.normal_force
    constant = {"amplitude": force, "start": 0.0, "duration": float("inf")}
    drive = replace(
        drive,
        plain=replace(plain, belt_speed=belt_speed),
        force=RandomCourse("step", constant),
        position=0.0,
        velocity=0.0,
    )
    found, breakpoints = drive.motion()
    errors = difference(drive, drive.solution(), found, sticks_of(breakpoints))
    assert errors.state < 1e-7
    assert errors.events < 1e-7


TOP_SPEED = 3.0
"""Faster, in V, than any motion of the drives below relative to their belts."""


def states(drive: Drive, periods: float) -> Array:
    motion = Motion(drive, 0.3, 0.0)
    found = [(motion.position, motion.velocity)]
    for _ in range(round(20 * periods)):
        motion.advance(drive.natural_period / 20.0)
        found.append((motion.position, motion.velocity))
    return np.array(found)


def table_of(curve: Callable[[Array], Array], points: int) -> Table:
    speeds = np.linspace(0.0, TOP_SPEED, points)
    values = np.asarray(curve(speeds)) * np.ones(points)
    return Table((*zip(speeds.tolist(), values.tolist(), strict=True), (2.0 * TOP_SPEED, 0.0)))


def directional(make: Callable[[float], FrictionLaw]) -> FrictionLaw:
    return Directional(make(1.0), make(0.8))


@pytest.mark.parametrize("belt_speed", [0.1, -0.3, 0.0])
@pytest.mark.parametrize(
    "make",
    [
        lambda share: Coulomb(share * 0.4),
        lambda share: Coulomb(share * 0.4, 0.05),
        lambda share: Linear(share * 0.4, 0.05),
    ],
    ids=["constant", "rising", "falling"],
)
def test_the_table_of_a_straight_law_gives_its_motion(
    make: Callable[[float], FrictionLaw], belt_speed: float
) -> None:
    """The interpolation is exact for a straight line."""

    def table(share: float) -> FrictionLaw:
        law = make(share)
        return table_of(lambda speed: -law.coefficient(speed, 1.0), 7)

    drive = replace(PAPER, belt_speed=belt_speed, friction=directional(make))
    expected = states(drive, 20.0)
    assert np.abs(expected[:, 1] - belt_speed).max() < TOP_SPEED / 2.0
    found = states(replace(drive, friction=directional(table)), 20.0)
    assert np.abs(found - expected).max() < 1e-9


@pytest.mark.parametrize(
    "law",
    [Stribeck(0.4, 0.25, 2.0), Exponential(0.4, 0.25, 0.5, 0.02, 2.0)],
    ids=lambda law: law.name,
)
def test_the_table_of_a_curve_gives_its_motion_to_the_accuracy_of_the_table(
    law: FrictionLaw,
) -> None:
    drive = replace(PAPER, belt_speed=0.1, friction=law)
    expected = states(drive, 5.0)
    between = np.linspace(0.0, TOP_SPEED / 2.0, 100_001)
    for points in (31, 121, 481):
        table = table_of(lambda speed: -law.coefficient(speed, 1.0), points)
        accuracy = np.abs(table.coefficient(between, 1.0) - law.coefficient(between, 1.0)).max()
        error = np.abs(states(replace(drive, friction=table), 5.0) - expected).max()
        assert accuracy < 0.1 * (30.0 / points) ** 2
        assert error < 10.0 * accuracy
