"""Random drives whose friction has a memory, each with its reference.

What the package gets, and the formulas of the reference, come from the same numbers.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from benchmarks import memory_reference
from benchmarks.memory_reference import Array, Curve, MemoryDrive
from benchmarks.random_drives import Random, Units, random_law, random_units
from stickslip_ros.model import friction
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion import Motion

LAWS = ("dahl", "lugre", "elasto_plastic", "maxwell_slip")
CURVES = ("exponential", "exponent", "stribeck", "coulomb", "table")
PERIODS = 20
SAMPLES = 4
"""Per natural period."""
STORED_EVERY = 3
"""Every so many samples are stored: at equal phases of the period they would be much alike."""


def size_of(curve: Curve, viscous: float, speed: float) -> Curve:
    """Return the size of a curve without its viscous part, also where only a solver tries it."""

    def size(w: float) -> float:
        w = min(max(w, -1e-3 * speed), 1e3 * speed)
        return curve(w) - viscous * w

    return size


def random_memory_law(
    name: str, draw: Random, units: Units, shared: dict[str, float], curve_name: str
) -> tuple[Any, Any]:
    """Return a law, and one direction of the reference; `shared` is equal in both directions."""
    length, speed, rate = units.length, units.speed, units.rate
    stiffness = shared["stiffness"] / length
    if name == "dahl":
        static = float(draw.uniform(0.3, 0.6))
        return friction.Dahl(static, stiffness), memory_reference.Law(lambda _: static, stiffness)
    static_law, whole = random_law(curve_name, draw, speed)
    viscous = float(getattr(static_law, "viscous", 0.0))
    size, least = size_of(whole, viscous, speed), float(static_law.dry.size_range[0])
    damping = shared["damping"] * sqrt(stiffness / length) * length / speed
    if name == "maxwell_slip":
        elements, attraction = int(shared["elements"]), rate * shared["attraction"]
        return (
            friction.MaxwellSlip(static_law, stiffness, elements, attraction),
            memory_reference.MaxwellSlip(size, stiffness, 0.0, viscous, elements, attraction),
        )
    if name == "lugre":
        law = friction.LuGre(static_law, stiffness, damping)
        return law, memory_reference.Law(size, stiffness, damping, viscous)
    share = float(draw.uniform(0.3, 0.9))
    return (
        friction.ElastoPlastic(static_law, stiffness, damping, share),
        memory_reference.ElastoPlastic(size, stiffness, damping, viscous, least, share),
    )


@dataclass(frozen=True)
class RandomMemoryDrive:
    """A drive with its start, SI units, and the laws of its reference."""

    drive: Drive
    forward: Any
    backward: Any
    position: float
    velocity: float

    @property
    def times(self) -> Array:
        return self.drive.natural_period / SAMPLES * np.arange(PERIODS * SAMPLES + 1)

    def reference(self, rtol: float) -> Array:
        """Return position and velocity at `times` by scipy."""
        drive = self.drive
        return MemoryDrive(
            drive.mass,
            drive.damping,
            drive.stiffness,
            drive.normal_force,
            drive.belt_speed,
            self.forward,
            self.backward,
            solver=DOP853,
            rtol=rtol,
        ).run(self.position, self.velocity, self.times)

    def motion(self) -> Array:
        """Return position and velocity at `times` by the package."""
        motion = Motion(self.drive, self.position, self.velocity)
        found = [(motion.position, motion.velocity)]
        for duration in np.diff(self.times).tolist():
            motion.advance(duration)
            found.append((motion.position, motion.velocity))
        return np.array(found)

    def error(self, found: Array, expected: Array) -> float:
        """Return the largest difference after the start, in shares of the range of the motion."""
        least = 1e-3 * np.array([self.drive.length_scale, self.drive.speed_scale])
        scales = np.maximum(np.ptp(expected, axis=0), least)
        return float((np.abs(found - expected)[1:] / scales).max())


def random_memory_drive(law: str, seed: int) -> RandomMemoryDrive:
    """Return a drive; every other one has friction by direction."""
    draw = np.random.default_rng([seed, LAWS.index(law), 23])
    units = random_units(draw)
    shared = {
        "stiffness": float(10.0 ** draw.uniform(1.3, 2.7)),
        "damping": float(draw.uniform(0.0, 1.0)),
        "elements": float(draw.integers(1, 6)),
        "attraction": float(10.0 ** draw.uniform(0.5, 2.0)),
    }
    draw.uniform(size=2)  # as when the committed results were made
    curve = CURVES[seed % len(CURVES)]
    made, forward = random_memory_law(law, draw, units, shared, curve)
    backward = forward
    if seed % 2:
        reverse, backward = random_memory_law(law, draw, units, shared, curve)
        made = friction.Directional(made, reverse)
    belt = units.belt_speed(draw)
    drive = Drive(
        mass=units.mass,
        damping=float(draw.uniform(0.0, 0.1) * units.rate * units.mass),
        stiffness=units.stiffness,
        normal_force=units.normal,
        belt_speed=belt,
        friction=made,
    )
    velocity = [0.0, belt, draw.uniform(-0.5, 0.5) * units.speed][draw.integers(3)]
    position = draw.choice([0.0 if belt else 1.0, draw.uniform(-1.0, 1.0)]) * units.length
    return RandomMemoryDrive(drive, forward, backward, float(position), float(velocity))
