"""Slide and motor against the independent solution of `two_masses`."""

import numpy as np
import pytest

from benchmarks.two_masses import Array, Bristles, Curve, Piece, TwoMasses
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Dahl, Exponential, FrictionLaw, LuGre
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.signals import NO_SIGNAL, step
from stickslip_ros.motion import Motion

PIECES, SAMPLES = 10, 8
LAWS = ("coulomb", "exponential", "lugre", "dahl")


def random_drive(seed: int, law: str) -> tuple[TwoMasses, Drive]:
    """A drive with forces that change every half period, and its independent solution."""
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
    return independent, drive


def states_of(motion: Motion) -> list[float]:
    assert motion.motor is not None
    memory = motion.memory or (0.0,)
    return [motion.position, motion.velocity, *motion.motor, *memory]


def motion_of(drive: Drive, pieces: list[Piece], times: Array) -> Array:
    """The package's states at times."""
    motion, now, found = Motion(drive, 0.0, 0.0), 0.0, []
    remaining = list(pieces)
    for time in times.tolist():
        while remaining and remaining[0].end < time:
            motion.advance(remaining[0].end - now)
            now = remaining.pop(0).end
        motion.set_forces(remaining[0].motor_force, remaining[0].slide_force)
        motion.advance(time - now)
        now = time
        found.append(states_of(motion))
    return np.array(found)


def times_of(pieces: list[Piece]) -> Array:
    starts = np.array([0.0, *(piece.end for piece in pieces)])
    parts = (np.arange(SAMPLES) + 0.5) / SAMPLES
    return (starts[:-1, None] + np.diff(starts)[:, None] * parts).ravel()


def error(seed: int, law: str) -> float:
    """The largest difference of a state, in its range."""
    independent, drive = random_drive(seed, law)
    times = times_of(independent.pieces)
    expected, found = independent.run(times), motion_of(drive, independent.pieces, times)
    compared = 5 if isinstance(independent.law, Bristles) else 4
    ranges = np.maximum(np.ptp(expected, axis=0)[:compared], 1e-6 * drive.length_scale)
    return float((np.abs(found - expected)[:, :compared] / ranges).max())


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_a_random_drive_moves_as_the_independent_solution(seed: int, law: str) -> None:
    assert error(seed, law) < 1e-8
