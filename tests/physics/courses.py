"""Random courses: a drive, its start, and forces that are each held for a while."""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from hypothesis import strategies as st

from stickslip_ros.physics.measures.breakpoints import Breakpoints
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
from stickslip_ros.physics.motion import Motion, RecordedMotion

# Rounding grows without bound where a motion just misses sticking, or just does not. Examples
# closer to that are left out: by a thousandth in relative speed (of V) and in reaction (of N).
GRAZING = 1e-3

# Examples that run away, or are about to, are left out too: faster than a hundred V.
FASTEST = 100.0


@dataclass(frozen=True)
class Course:
    """SI units."""

    drive: Drive
    position: float
    velocity: float
    forces: tuple[float, ...]
    durations: tuple[float, ...]

    def motion(self) -> Motion:
        return RecordedMotion(self.drive, self.position, self.velocity)

    def run(self) -> tuple[Motion, list[Breakpoints]] | None:
        """Return the motion at the end and the breakpoints of each force; None if left out."""
        motion = self.motion()
        pieces: list[Breakpoints] = []
        for force, duration in zip(self.forces, self.durations, strict=True):
            motion.force = force
            if self._near_the_limit(motion.position, motion.velocity, force):
                return None
            motion.advance(duration)
            pieces.append(motion.take_breakpoints())
            if motion.unbounded or self._runs_away_or_grazes(pieces[-1], force):
                return None
        return motion, pieces

    def dimensionless(self) -> "Course":
        drive = self.drive
        unit = Drive(
            mass=1.0,
            damping=drive.damping_coefficient,
            stiffness=1.0,
            normal_force=1.0,
            belt_speed=drive.belt_speed / drive.speed_scale,
            friction=drive.friction.scaled(drive.speed_scale),
        )
        return Course(
            unit,
            self.position / drive.length_scale,
            self.velocity / drive.speed_scale,
            tuple(force / drive.normal_force for force in self.forces),
            tuple(duration * drive.angular_frequency for duration in self.durations),
        )

    def _near_the_limit(self, position: float, velocity: float, force: float) -> bool:
        """Whether the slide is at the belt's speed with friction just able to hold it, or not."""
        drive = self.drive
        reaction = drive.stiffness * position + drive.damping * drive.belt_speed - force
        limits = drive.friction.limits
        excess = abs(reaction) / drive.normal_force - limits[0 if reaction < 0.0 else 1]
        return velocity == drive.belt_speed and abs(excess) < GRAZING

    def _runs_away_or_grazes(self, breakpoints: Breakpoints, force: float) -> bool:
        drive = self.drive
        speed = np.abs(breakpoints.velocity) / drive.speed_scale
        if speed.max() > FASTEST:
            return True
        relative_speed = np.abs(breakpoints.velocity - drive.belt_speed) / drive.speed_scale
        # A landing is at the belt's speed exactly, save for the rounding of the scale.
        at_belt_speed = relative_speed < 1e-14
        if np.any(~at_belt_speed & (relative_speed < GRAZING)):
            return True
        landings = breakpoints[at_belt_speed & ~breakpoints.sticking]
        return any(
            self._near_the_limit(float(position), drive.belt_speed, force)
            for position in landings.position
        )


def _decades(lowest: float, highest: float) -> st.SearchStrategy[float]:
    return st.floats(lowest, highest).map(lambda exponent: 10.0**exponent)


@st.composite
def friction_laws(draw: st.DrawFn) -> FrictionLaw:
    """A law in dimensionless form."""
    static = draw(st.floats(0.05, 1.0))
    lower = draw(st.floats(0.0, 1.0)) * static
    speed = draw(st.floats(0.2, 2.0))
    law = draw(
        st.sampled_from(
            [
                Stribeck(static, lower, speed),
                Coulomb(static, draw(st.floats(0.0, 0.5))),
                Linear(static, draw(st.floats(-1.0, 1.0))),
                Exponential(static, lower, speed, draw(st.floats(-0.5, 1.0))),
                Exponential(static, lower, speed, 0.1, draw(st.sampled_from([1.5, 2.0]))),
                Table(((0.0, static), (speed, lower), (2.0 * speed, 0.5 * static))),
            ]
        )
    )
    share = draw(st.none() | st.floats(0.5, 1.0))
    return law if share is None else Directional(law, weaker(law, share))


def weaker(law: FrictionLaw, share: float) -> FrictionLaw:
    """Return a law with a share of its coefficients."""
    if isinstance(law, Table):
        return Table(tuple((speed, share * value) for speed, value in law.points))
    names = ("static", "minimum", "kinetic", "slope", "viscous")
    own = {name: share * getattr(law, name) for name in names if name in law.constants()}
    return replace(law, **own)


def above_denormal(number: float) -> float:
    """Return 0 for a speed at which the time of an event is a denormal number."""
    return number if abs(number) > 1e-100 else 0.0


@st.composite
def courses(draw: st.DrawFn) -> Course:
    """Courses of some natural periods; belts at rest, and starts at belt speed, among them."""
    mass = draw(_decades(-3.0, 4.0))
    angular_frequency = draw(_decades(-1.0, 4.0))
    normal_force = draw(_decades(-3.0, 5.0))
    stiffness = mass * angular_frequency**2
    length = normal_force / stiffness
    speed = length * angular_frequency
    belt = draw(st.one_of(st.just(0.0), st.floats(0.05, 2.0), st.floats(-2.0, -0.05)))
    drive = Drive(
        mass=mass,
        damping=draw(st.floats(0.0, 1.5)) * sqrt(stiffness * mass),
        stiffness=stiffness,
        normal_force=normal_force,
        belt_speed=belt * speed,
        friction=draw(friction_laws()).scaled(1.0 / speed),
    )
    velocity = draw(st.one_of(st.just(belt), st.floats(-2.0, 2.0).map(above_denormal))) * speed
    pieces = draw(
        st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(0.1, 8.0)), min_size=1, max_size=4)
    )
    return Course(
        drive,
        draw(st.floats(-3.0, 3.0)) * length,
        velocity,
        tuple(force * normal_force for force, _ in pieces),
        tuple(duration / angular_frequency for _, duration in pieces),
    )
