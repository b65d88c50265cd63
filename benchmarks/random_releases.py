"""Random drives of two bodies that stick to the guide and are released, together and in turn.

Dry friction may hold slide and motor; both often start at the speed of the guide, and the forces
on them change about once in half a period.
"""

from typing import NamedTuple

import numpy as np

from benchmarks.two_masses import Array, Curve, Piece, TwoMasses
from stickslip_ros.errors import RunError
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Exponential
from stickslip_ros.model.motor import Motor
from stickslip_ros.motion import Motion

PIECES, SAMPLES = 4, 3
"""Constant forces of a motion, and instants in each at which it is compared."""


class Released(NamedTuple):
    drive: Drive
    independent: TwoMasses
    start: tuple[float, float, float, float]
    """Position and velocity of the slide, and of the motor."""
    times: Array

    @property
    def ranges(self) -> Array:
        """What counts as large: the spring that friction holds, and the speed that it gives."""
        own = self.drive.length_scale, self.drive.speed_scale
        return np.array([*own, *own]) * float(self.drive.friction.static)

    def motion(self) -> Array:
        """Return the states at the times, as the package finds them; raises RunError."""
        x, v, far, rate = self.start
        motion, now, found = Motion(self.drive, 0.0, 0.0), 0.0, []
        motion.restart(x, v, motor=(far, rate))
        pieces = iter(self.independent.pieces)
        piece = next(pieces)
        motion.set_forces(piece.motor_force, piece.slide_force)
        for time in self.times.tolist():
            while time > piece.end:
                motion.advance(piece.end - now)
                now, piece = piece.end, next(pieces)
                motion.set_forces(piece.motor_force, piece.slide_force)
            motion.advance(time - now)
            now = time
            if motion.unbounded or motion.motor is None:
                raise RunError("the motion is unbounded")
            found.append([motion.position, motion.velocity, *motion.motor])
        return np.array(found)

    def solution(self, rtol: float = 1e-13) -> Array:
        """Return the same by scipy's DOP853."""
        self.independent.rtol = rtol
        return self.independent.run(self.times, (*self.start, 0.0))[:, :4]


def released(seed: int) -> Released:
    """Return a drive, its forces and its start."""
    random = np.random.default_rng([seed, 67])
    mass, stiffness, normal = (10.0 ** random.uniform([0, 4, 2], [2, 6, 3])).tolist()
    own = mass * 10.0 ** float(random.uniform(-1, 1))
    critical = (stiffness * mass) ** 0.5
    speed = normal / critical
    length = np.pi / (stiffness * (1 / mass + 1 / own)) ** 0.5
    static = float(random.uniform(0.1, 0.5))
    falls = bool(random.integers(2))
    curve = Curve(
        static,
        static * float(random.uniform(0.5, 0.9)) if falls else static,
        float(random.uniform(0.2, 0.5)) * speed,
    )
    belt = float(random.choice([0.0, 0.3, -0.4, 0.8])) * speed
    damping, guide, bearing = (
        critical * float(random.choice(choices))
        for choices in ([0.0, 0.02, 0.1, 1.0], [0.0, 0.05], [0.0, 0.05])
    )
    motor = Motor(mass=own, damping=bearing, friction=float(random.uniform(0.02, 0.4)) * normal)
    law = (
        Exponential(curve.static, curve.kinetic, decay_speed=curve.decay, viscous=0.0, exponent=1.0)
        if falls
        else Coulomb(static, viscous=0.0)
    )
    drive = Drive(
        mass, damping, stiffness, normal, belt, friction=law, motor=motor, guide_damping=guide
    )
    ends = length * np.cumsum(random.uniform(0.3, 1.7, PIECES))
    forces = (
        normal * random.uniform(-0.5, 0.5, (PIECES, 2)) * random.choice([0.4, 1.0], (PIECES, 2))
    )
    pieces = [
        Piece(end, *force, belt)
        for end, force in zip(ends.tolist(), forces.tolist(), strict=True)
    ]  # fmt: skip
    thrown = belt + speed * random.uniform(-0.5, 0.5, 2)
    held = random.random(2) < (0.3, 0.8)
    v, rate = np.where(held, belt, thrown).tolist()
    start = float(random.uniform(-0.5, 0.5)) * normal / stiffness, v, 0.0, rate
    starts = np.array([0.0, *ends[:-1]])
    parts = (np.arange(SAMPLES) + 0.5) / SAMPLES
    return Released(
        drive,
        TwoMasses(
            mass, damping, stiffness, guide, normal, own, bearing, motor.friction, curve, pieces
        ),
        start,
        (starts[:, None] + (ends - starts)[:, None] * parts).ravel(),
    )
