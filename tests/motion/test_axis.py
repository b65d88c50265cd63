"""An axis on a guide: no spring holds the slide, and forces alone move it."""

from dataclasses import replace
from math import expm1, inf, log, log1p, nextafter

import numpy as np
import pytest

from benchmarks.dop853 import Signal, level
from benchmarks.random_drives import drive_of_place
from stickslip_ros.model import signals
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Directional, Exponential
from stickslip_ros.motion import Motion
from tests.drives import FEED_DRIVE

# Of Janot, Gautier, Brunot, 2019: friction in N over 1000 N, and an offset.
AXIS = Drive(
    mass=95.154,
    damping=0.0,
    stiffness=0.0,
    normal_force=1000.0,
    belt_speed=0.0,
    friction=Directional(
        Coulomb(static=0.020144, viscous=0.1667061), Coulomb(static=0.0206277, viscous=0.2404236)
    ),
    bias_force=3.1648,
)
FORWARD, BACKWARD = (20.144, 166.7061), (20.6277, 240.4236)
"""Coulomb friction (N) and viscous friction (N s/m) of either direction."""


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_push_dies_out_as_the_closed_form_says(sign: float) -> None:
    """From s v0 to rest by m v' = -s (F + V s v) + bias."""
    motion, start, speed = Motion(AXIS, 0.01, sign * 0.3), 0.01, 0.3
    coulomb, viscous = FORWARD if sign > 0.0 else BACKWARD
    net, rate = coulomb - sign * AXIS.bias_force, viscous / AXIS.mass
    stop = log1p(viscous * speed / net) / rate
    motion.advance(0.5 * stop)
    decayed = (speed + net / viscous) * (-expm1(-rate * 0.5 * stop))
    assert motion.velocity == pytest.approx(sign * (speed - decayed), rel=1e-13)
    path = decayed / rate - net / viscous * 0.5 * stop
    assert motion.position == pytest.approx(start + sign * path, rel=1e-13)
    motion.advance(stop)
    assert motion.sticking
    assert motion.velocity == 0.0
    path = (speed - net / viscous * log(1.0 + viscous * speed / net)) / rate
    assert motion.position == pytest.approx(start + sign * path, rel=1e-13)


def test_it_breaks_loose_at_its_static_friction_in_either_direction() -> None:
    for sign, (coulomb, _) in ((1.0, FORWARD), (-1.0, BACKWARD)):
        for share in (1.0 - 1e-12, 1.0 + 1e-12):
            motion = Motion(AXIS, 0.2, 0.0)
            motion.force = sign * share * coulomb - AXIS.bias_force
            motion.advance(1.0)
            assert motion.sticking == (share < 1.0)
            assert (motion.position == 0.2) == (share < 1.0)


@pytest.mark.parametrize("law", [Coulomb(0.02), Exponential(0.02, 0.01, 0.1, 0.0)])
def test_a_force_that_is_just_too_large_does_not_stop_the_run(law: Coulomb | Exponential) -> None:
    motion = Motion(replace(AXIS, friction=law, bias_force=0.0), 0.1, 0.0)
    for _ in range(100):
        motion.force = nextafter(20.0, inf)
        motion.advance(1.0)
        motion.force = 20.0
        motion.advance(1.0)
    assert motion.position >= 0.1


HELD = [
    AXIS,
    replace(AXIS, friction=Exponential(0.03, 0.02, 0.01, 0.1), damping=20.0),
    replace(AXIS, load=signals.sine(amplitude=50.0, frequency=3.0)),
    replace(FEED_DRIVE, belt_speed=0.0),
    replace(FEED_DRIVE, belt_speed=0.0, bias_force=-40.0),
]
"""The last ones have a spring."""
HOUR = 3600.0  # s


def break_away(drive: Drive, sign: float, position: float) -> float:
    """Return the control force (N) with 0.9 of the least friction that holds the slide."""
    forward, backward = drive.friction.limits
    limit = (forward if sign > 0.0 else backward) * (drive.normal_force + drive.load.bounds[0])
    return sign * 0.9 * limit + drive.stiffness * position - drive.bias_force


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("drive", HELD)
def test_stick_is_stick(drive: Drive, sign: float) -> None:
    """An hour at 0.9 of the break-away force: no drift at all, in one step and in many."""
    start = 0.1 * sign
    for steps in (1, 100):
        motion = Motion(drive, start, 0.0)
        motion.force = break_away(drive, sign, start)
        before = motion.position
        assert before == pytest.approx(start, rel=1e-15)
        for _ in range(steps):
            motion.advance(HOUR / steps)
        assert motion.sticking
        assert (motion.position, motion.velocity) == (before, 0.0)


@pytest.mark.parametrize("belt_moves", [False, True])
@pytest.mark.parametrize("seed", [3, pytest.param(5, marks=pytest.mark.long)])
def test_random_axes_move_as_another_integrator_says(seed: int, belt_moves: bool) -> None:
    """Random masses, laws by direction and held forces; with signals of belt and load too."""
    place = "together" if belt_moves else "disturbance"
    case = drive_of_place(seed, "exponential", "sine", place)
    rng, normal = np.random.default_rng([seed, belt_moves]), case.plain.normal_force
    bias = 0.1 * normal * rng.uniform(-1.0, 1.0)
    forces = np.repeat(normal * rng.uniform(-0.9, 0.9, 30), rng.integers(5, 20, 30)).tolist()
    times = case.sample * np.arange(len(forces) + 1)
    held = [
        level(time, force + bias) for time, force in zip([-inf, *times[1:]], forces, strict=False)
    ]
    other = replace(
        case.reference(), stiffness=0.0, force=Signal(held), longest_step=0.2 * case.sample
    )
    solution = other.run(case.position, case.velocity, times)
    expected = np.column_stack([solution.position, solution.velocity])[1:]
    drive = replace(case.drive, stiffness=0.0, bias_force=bias)
    motion, found = Motion(drive, case.position, case.velocity), list[tuple[float, float]]()
    for force in forces:
        motion.force = force
        motion.advance(case.sample)
        found.append((motion.position, motion.velocity))
    assert solution.sticks
    scale = np.abs(expected).max(axis=0)
    assert np.array(found) / scale == pytest.approx(expected / scale, abs=1e-9)
