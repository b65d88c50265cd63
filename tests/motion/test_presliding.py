"""Presliding: hysteresis and drift of a slide that no spring holds, below break-away.

Strong damping lets the slide follow each step of the force in one direction. Friction that does not
depend on the rate then has no other path than for a slow force, and the formulas hold exactly.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import exp, log

import numpy as np
import pytest

from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Coulomb,
    Dahl,
    ElastoPlastic,
    Exponential,
    FrictionLaw,
    FrictionObserver,
    LuGre,
    MaxwellSlip,
)
from stickslip_ros.model.signals import NO_SIGNAL, step
from stickslip_ros.motion import Motion

COEFFICIENT, STIFFNESS, NORMAL = 0.5, 1000.0, 2.0
LIMIT = NORMAL * COEFFICIENT
DEFLECTION = COEFFICIENT / STIFFNESS
SETTLING = 30.0
"""Time, s, in which the slide comes to rest after a step of the force."""


def displacements(law: FrictionLaw, forces: Sequence[float], hold: float = SETTLING) -> np.ndarray:
    """The displacements at the end of each held force."""
    drive = Drive(1.0, 400.0, 0.0, NORMAL, 0.0, law)
    motion, found = Motion(drive, 0.0, 0.0), []
    for force in forces:
        motion.force = force
        motion.advance(hold)
        found.append(motion.position)
    return np.array(found)


@pytest.mark.parametrize(
    "law",
    [Dahl(COEFFICIENT, STIFFNESS), LuGre(Coulomb(COEFFICIENT), STIFFNESS, 10.0)],
    ids=lambda law: law.name,
)
def test_a_load_with_a_bias_drifts_with_every_cycle(law: FrictionLaw) -> None:
    """By (f_c/S) ln((1 - (F1/F_c)^2)/(1 - (F2/F_c)^2)), from z' = v - S |v| z/f_c."""
    low, high = -0.2, 0.8
    found = displacements(law, [high * LIMIT, low * LIMIT] * 6)[::2]
    drift = DEFLECTION * log((1.0 - low**2) / (1.0 - high**2))
    assert np.diff(found)[1:] == pytest.approx([drift] * 4, rel=1e-9)


@pytest.mark.parametrize(
    "law",
    [
        Dahl(COEFFICIENT, STIFFNESS),
        LuGre(Coulomb(COEFFICIENT), STIFFNESS, 10.0),
        ElastoPlastic(Coulomb(COEFFICIENT), STIFFNESS, 10.0, 0.7),
        MaxwellSlip(Coulomb(COEFFICIENT), STIFFNESS, 4, 100.0),
    ],
    ids=lambda law: law.name,
)
def test_a_load_of_zero_mean_closes_its_loop(law: FrictionLaw) -> None:
    found = displacements(law, [0.8 * LIMIT, -0.8 * LIMIT] * 40)
    loops = found.reshape(-1, 2)[-2:]
    assert loops[1] == pytest.approx(loops[0], abs=1e-6 * DEFLECTION)
    assert loops[1, 0] - loops[1, 1] > DEFLECTION


@pytest.mark.parametrize("velocity", [0.0, 1e-3])
@pytest.mark.parametrize(
    "law",
    [Dahl(0.4, 1e3), LuGre(Coulomb(0.4), 1e3, 30.0), MaxwellSlip(Coulomb(0.4), 1e3, 2, 100.0)],
    ids=lambda law: law.name,
)
def test_a_slide_that_nothing_moves_rests(law: FrictionLaw, velocity: float) -> None:
    motion = Motion(Drive(100.0, 200.0, 0.0, 1e3, 0.0, law), 0.0, velocity)
    for _ in range(40):
        motion.advance(1.0)
    if velocity:
        assert abs(motion.velocity) < 1e-10
        assert motion.velocity == 0.0 or abs(motion.velocity) > 1e-300
    else:
        assert (motion.position, motion.velocity, motion.friction_force) == (0.0, 0.0, 0.0)


def test_elements_close_a_loop_with_a_bias() -> None:
    found = displacements(MaxwellSlip(Coulomb(COEFFICIENT), STIFFNESS), [0.8, -0.2] * 6)
    loops = found.reshape(-1, 2)
    assert loops[1:] == pytest.approx(np.broadcast_to(loops[1], (5, 2)), abs=1e-12 * DEFLECTION)
    assert loops[1, 0] > loops[1, 1]


def test_an_elasto_plastic_contact_does_not_drift_below_its_break_away() -> None:
    law = ElastoPlastic(Coulomb(COEFFICIENT), STIFFNESS, 10.0, 0.7)
    below = [0.69 * LIMIT, 0.2 * LIMIT]
    found = displacements(law, below * 180, hold=10.0)  # an hour
    assert found[::2] == pytest.approx(np.full(180, 0.69 * DEFLECTION), rel=1e-12)
    above = displacements(law, [0.9 * LIMIT, 0.2 * LIMIT] * 5)[::2]
    assert np.all(np.diff(above) > 1e-3 * DEFLECTION)


@pytest.mark.parametrize("by_signal", [True, False])
@pytest.mark.parametrize("faster", [0.06, 0.02])
def test_elements_slip_on_where_the_belt_jumps_without_a_change_of_direction(
    by_signal: bool, faster: float
) -> None:
    """S_i z_i' = C (s/n - S_i z_i/g) from the steady slip of before: friction tends to the new one.

    The slide is so heavy that its speed stays 0; an element put back to sticking would be pulled
    at S v, from 0.27 to the new limit and beyond within a sample.
    """
    curve, rate, weight = Exponential(0.4, 0.25, 0.02), 100.0, 1e9
    law = MaxwellSlip(curve, 1e5, 4, attraction=rate)
    jump = step(faster - 0.04, start=0.5) if by_signal else NO_SIGNAL
    drive = Drive(weight, 0.0, 0.0, 1.0, 0.04, law, belt=jump)
    motion = Motion(drive, 0.0, 0.0)
    motion.advance(0.5)
    before, after = (float(curve.coefficient(-speed, -1.0)) for speed in (0.04, faster))
    assert motion.friction_force == pytest.approx(before, rel=1e-6)
    if not by_signal:
        motion.drive = replace(drive, belt_speed=faster)
    for number in range(1, 6):
        motion.advance(1e-3)
        expected = after + (before - after) * exp(-rate * 1e-3 * number / after)
        assert motion.friction_force == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", ["dahl", "lugre", "elasto_plastic", "maxwell_slip"])
def test_an_observer_follows_the_memory_of_the_motion(name: str) -> None:
    """Under a belt that moves a heavy slide slowly the speed hardly changes in a sample."""
    curve = Exponential(0.5, 0.3, 0.01)
    law = {
        "dahl": Dahl(0.5, 1e4),
        "lugre": LuGre(curve, 1e4, 30.0),
        "elasto_plastic": ElastoPlastic(curve, 1e4, 30.0),
        "maxwell_slip": MaxwellSlip(curve, 1e4),
    }[name]
    drive = Drive(1.0, 5.0, 20.0, 1.0, 0.02, law)
    motion, period = Motion(drive, 0.0, 0.0), 1e-5
    observer = FrictionObserver(law, motion.memory)
    found: list[tuple[float, float]] = []
    for _ in range(10_000):
        before = motion.velocity
        motion.advance(period)
        relative_speed = 0.5 * (before + motion.velocity) - drive.belt_speed
        found.append((observer.step(relative_speed, period), motion.friction_force))
    estimated, true = np.array(found).T
    assert np.abs(estimated - true).max() < 2e-3
