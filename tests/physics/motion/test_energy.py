"""The energy of a slide on a belt, with a load and under a disturbance that change with time.

The works are integrals over the motion of the package, of forces from the independent formulas.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.motion import Motion
from tests.examples import examples
from tests.physics.motion.dop853 import Dop853Drive
from tests.physics.motion.random_drives import KINDS, LAWS, RandomDrive, random_drive

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
PERIODS = 4


@dataclass
class Works:
    """Works so far, J."""

    belt: float = 0.0
    """Of the belt on the slide, through friction."""
    disturbance: float = 0.0
    damper: float = 0.0
    """Dissipated."""
    friction: float = 0.0
    """Dissipated: of the friction force over the distance by which the slide slips."""
    least_dissipation: float = 0.0
    """Least power that friction has dissipated, W; below zero it would drive."""

    @property
    def gained(self) -> float:
        return self.belt + self.disturbance - self.damper - self.friction


class Meter:
    """Integrates powers over a motion that it advances."""

    def __init__(self, drive: RandomDrive) -> None:
        plain = drive.plain
        self.motion = Motion(drive.drive, drive.position, drive.velocity)
        self.reference: Dop853Drive = drive.reference(PERIODS)
        self.works, self._now = Works(), 0.0
        _, breakpoints = drive.motion(PERIODS)
        corners = [*self.reference.belt.starts, *self.reference.normal.starts]
        self._splits = np.unique([*breakpoints.time, *corners])
        # The curvature of a table jumps at its points.
        per_unit = 60.0 if plain.friction.name == "table" else 20.0
        self._longest = 1.0 / (per_unit * plain.angular_frequency)

    def advance(self, duration: float) -> None:
        start, end = self._now, self._now + duration
        inside = self._splits[(self._splits > start) & (self._splits < end)]
        for before, after in pairwise([start, *inside.tolist(), end]):
            panels = int((after - before) / self._longest) + 1
            for first, last in pairwise(np.linspace(before, after, panels + 1).tolist()):
                self._add_panel(first, last)
        self.motion.advance(end - self._now)
        self._now = end

    def _add_panel(self, start: float, end: float) -> None:
        drive, motion, works = self.reference, self.motion, self.works
        half, middle = 0.5 * (end - start), 0.5 * (start + end)
        belt, belt_rate = drive.belt.at(middle)
        (normal, _), (applied, _) = drive.normal.at(middle), drive.force.at(middle)
        for node, weight in zip(NODES.tolist(), (half * WEIGHTS).tolist(), strict=True):
            time = middle + half * node
            motion.advance(time - self._now)
            self._now = time
            x, y, moves, force = motion.position, motion.velocity, belt(time), applied(time)
            slip = y - moves
            if motion.sticking:
                friction = drive.mass * belt_rate(time) + drive.damping * moves
                friction += drive.stiffness * x - force
            else:
                curve = drive.forward if slip > 0.0 else drive.backward
                friction = -np.sign(slip) * normal(time) * curve(abs(slip))
                works.least_dissipation = min(works.least_dissipation, -friction * slip)
                works.friction -= weight * friction * slip
            works.belt += weight * friction * moves
            works.damper += weight * drive.damping * y * y
            works.disturbance += weight * force * y


def balance(drive: RandomDrive) -> tuple[float, Works]:
    """Return what is missing in the balance, J, and the works."""
    meter = Meter(drive)
    motion, reference = meter.motion, meter.reference

    def energy() -> float:
        kinetic = reference.mass * motion.velocity**2
        return 0.5 * (kinetic + reference.stiffness * motion.position**2)

    before = energy()
    rate = 1.0 / drive.sample
    loop = SampledLoop(
        motion,
        rate,
        0,
        expects_control=False,
        disturbance=drive.force.packaged,
        advance=meter.advance,
    )
    while loop.sample_number < round(PERIODS * drive.plain.natural_period * rate):
        loop.advance()
    return energy() - before - meter.works.gained, meter.works


@st.composite
def changing_drives(draw: st.DrawFn) -> RandomDrive:
    kinds: dict[str, Any] = {
        part: draw(st.sampled_from(("none", *KINDS))) for part in ("belt", "load", "force")
    }
    law, directional = draw(st.sampled_from(LAWS)), draw(st.booleans())
    return random_drive(draw(st.integers(0, 10**6)), law, directional=directional, **kinds)


@given(changing_drives())
@example(random_drive(0, "stribeck", directional=True, belt="sine", load="sine", force="sine"))
@example(random_drive(1, "exponent", directional=True, belt="trapezoid", load="ramp", force="step"))
@example(random_drive(2, "table", directional=True, belt="table", load="step", force="impulse"))
@examples(quick=5, thorough=100)
def test_the_energy_gained_is_that_of_belt_and_disturbance_without_what_is_dissipated(
    drive: RandomDrive,
) -> None:
    missing, works = balance(drive)
    scale = drive.plain.normal_force * drive.plain.length_scale
    assert abs(missing) < 1e-9 * scale
    assert works.friction >= 0.0
    assert works.least_dissipation == 0.0
