"""Slide and motor against the independent solution of `two_masses`."""

from dataclasses import replace

import numpy as np
import pytest

import stickslip_ros as ss
from benchmarks.random_releases import Released, released
from benchmarks.two_masses import Bristles, Curve
from stickslip_ros.model.friction import Dahl, LuGre
from stickslip_ros.model.signals import step
from stickslip_ros.motion import Motion


def with_bristles(seed: int, law: str) -> Released:
    """Return a drive whose friction has a memory, on a belt whose speed jumps on the way."""
    case = released(seed)
    drive, independent, static = case.drive, case.independent, case.drive.friction.static
    stiffness = 40.0 * drive.stiffness / drive.normal_force
    critical = (drive.stiffness * drive.mass) ** 0.5
    loss = 0.1 * critical / drive.normal_force
    lugre = LuGre(drive.friction, stiffness, loss), Bristles(independent.law, stiffness, loss)
    flat = Curve(static, static, decay=1.0)
    dahl = Dahl(static, stiffness), Bristles(flat, stiffness, 0.0)
    friction, described = lugre if law == "lugre" else dahl
    jump, first = 0.3 * drive.normal_force / critical, len(independent.pieces) // 2
    belt = step(jump, start=independent.pieces[first - 1].end)
    pieces = [
        piece._replace(belt_speed=piece.belt_speed + jump * (number >= first))
        for number, piece in enumerate(independent.pieces)
    ]
    return case._replace(
        drive=replace(drive, friction=friction, belt=belt),
        independent=replace(independent, law=described, pieces=pieces),
    )


@pytest.mark.parametrize("law", ["lugre", "dahl"])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_friction_with_a_memory_and_a_belt_that_jumps(seed: int, law: str) -> None:
    case = with_bristles(seed, law)
    assert np.all(np.abs(case.motion() - case.solution()) < 1e-8 * case.ranges)


def test_a_motor_that_friction_just_holds_is_released() -> None:
    """Rounding put the friction that it needs below the limit, at the instant of the release."""
    drive = ss.scenario("feed_drive_motor", "plant.motor.mass=40", "plant.damping=2000").plant
    motion = Motion(drive.as_drive(), 0.0, 0.0)
    motion.restart(0.0003717063578472491, 0.03237567876097893, motor=(0.0, 0.04))
    motion.set_forces(-364.86471500329105, 0.0)
    motion.advance(0.015)
    assert motion.motor is not None
    assert 0.039 < motion.motor.velocity < 0.0395


@pytest.mark.parametrize(
    "seed",
    [n if n in (0, 1, 2, 20) else pytest.param(n, marks=pytest.mark.long) for n in range(30)],
)
def test_releases_agree_with_an_independent_solution(seed: int) -> None:
    drive = released(seed)
    assert np.all(np.abs(drive.motion() - drive.solution()) < 1e-9 * drive.ranges)
