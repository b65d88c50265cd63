"""Slide and motor against the independent solution of `two_masses`."""

import numpy as np
import pytest

import stickslip_ros as ss
from benchmarks.random_releases import Released, released
from benchmarks.two_masses import Bristles, Curve, Piece, TwoMasses
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Dahl, Exponential, FrictionLaw, LuGre
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.signals import NO_SIGNAL, step
from stickslip_ros.motion import Motion

PIECES, SAMPLES = 10, 8
LAWS = ("coulomb", "exponential", "lugre", "dahl")


def random_drive(seed: int, law: str) -> Released:
    """A drive from rest with forces that change every half period, and its other solution."""
    random = np.random.default_rng([seed, LAWS.index(law)])
    mass, stiffness, normal = 10.0 ** random.uniform([0, 4, 2], [2, 6, 3])
    own = mass * 10.0 ** random.uniform(-1, 1)
    omega = (stiffness * (1 / mass + 1 / own)) ** 0.5
    critical = (stiffness * mass) ** 0.5
    static = random.uniform(0.2, 0.5)
    kinetic = static if law in ("coulomb", "dahl") else static * random.uniform(0.5, 0.9)
    speed = normal / critical
    belt = random.choice([0.0, 0.3, -0.4, 0.8]) * speed
    curve = Curve(static, kinetic, random.uniform(0.2, 0.5) * speed)
    steady = Exponential(static, kinetic, curve.decay, viscous=0.0)
    friction: FrictionLaw = Coulomb(static) if law == "coulomb" else steady
    described: Curve | Bristles = curve
    if law in ("lugre", "dahl"):
        bristles = random.uniform(20.0, 60.0) * stiffness / normal
        loss = 0.0 if law == "dahl" else 0.1 * critical / normal
        described = Bristles(curve, bristles, loss)
        friction = Dahl(static, bristles) if law == "dahl" else LuGre(steady, bristles, loss)
    motor = Motor(
        mass=own,
        damping=random.uniform(0.0, 0.1) * critical,
        friction=random.choice([0.0, 0.1, 0.4]) * normal,
    )
    jump = random.choice([0.0, 0.3]) * speed
    length = np.pi / omega
    ends = length * np.arange(1, PIECES + 1)
    forces = (
        normal * random.uniform(-1.0, 1.0, (PIECES, 2)) * random.choice([0.2, 1.0], (PIECES, 1))
    )
    pieces = [
        Piece(end, *force, belt + (jump if number >= PIECES // 2 else 0.0))
        for number, (end, force) in enumerate(zip(ends.tolist(), forces.tolist(), strict=True))
    ]
    damping, guide = random.uniform(0.0, 0.1, 2) * critical
    independent = TwoMasses(
        mass, damping, stiffness, guide, normal, own, motor.damping, motor.friction, described,
        pieces,
    )  # fmt: skip
    drive = Drive(
        mass, damping, stiffness, normal, belt, friction=friction, motor=motor,
        guide_damping=guide,
        belt=step(jump, start=PIECES // 2 * length) if jump else NO_SIGNAL,
    )  # fmt: skip
    instants = (np.arange(PIECES * SAMPLES) + 0.5) * length / SAMPLES
    return Released(drive, independent, (0.0, 0.0, 0.0, 0.0), instants)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_a_random_drive_moves_as_the_independent_solution(seed: int, law: str) -> None:
    case = random_drive(seed, law)
    found, expected = case.motion(), case.solution()
    ranges = np.maximum(np.ptp(expected, axis=0), 1e-6 * case.drive.length_scale)
    assert (np.abs(found - expected) / ranges).max() < 1e-8


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
    [n if n in (0, 1, 2, 20) else pytest.param(n, marks=pytest.mark.long) for n in range(50)],
)
def test_releases_agree_with_an_independent_solution(seed: int) -> None:
    drive = released(seed)
    assert np.all(np.abs(drive.motion() - drive.solution()) < 1e-9 * drive.ranges)
