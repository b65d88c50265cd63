"""Belts and loads that change with time, against another integrator and closed forms."""

from collections.abc import Generator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from benchmarks import dop853
from benchmarks.random_drives import (
    KINDS,
    LAWS,
    NONE,
    PERIODS,
    PLACES,
    RandomDrive,
    RandomSignal,
    difference,
    drive_of_place,
    sticks_of,
)
from stickslip_ros.errors import RunError
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Exponential
from stickslip_ros.model.signals import Signal, ramp, sine, step, trapezoid
from stickslip_ros.motion import Motion
from stickslip_ros.motion.sampled_loop import SampledLoop
from tests.drives import PAPER

REST = Drive(1.0, 0.0, 1.0, 1.0, 0.0, Coulomb(0.4))


def check(drive: RandomDrive, periods: float = PERIODS) -> None:
    found, breakpoints = drive.motion(periods)
    errors = difference(drive, drive.solution(periods), found, sticks_of(breakpoints))
    assert errors.state < 1e-7
    assert errors.events < 1e-7


def random_cases() -> Generator[Any]:
    """One drive for each course in each place, and some more where time is short.

    By a law with an exponent, a slide that breaks loose from an accelerating belt has a relative
    speed of zero to rounding, which may be below.
    """
    yield from (("exponent", "ramp", "belt", seed) for seed in (0, 1, 4))
    for seed, (i, kind), (j, place) in product(range(5), enumerate(KINDS), enumerate(PLACES)):
        law = LAWS[(seed + i) % len(LAWS)]
        quick = (seed + i + 3 * j) % 10 == 0
        if quick or seed == 0:
            yield pytest.param(law, kind, place, seed, marks=() if quick else pytest.mark.long)


@pytest.mark.parametrize(("law", "kind", "place", "seed"), list(random_cases()))
def test_motions_are_those_of_another_integrator(
    law: str, kind: str, place: str, seed: int
) -> None:
    """`python -m benchmarks.agreement` does the same with many more drives."""
    check(drive_of_place(seed, law, kind, place))


@pytest.mark.parametrize(("height", "sticks"), [(0.39, True), (0.41, False), (-0.41, False)])
def test_a_belt_that_accelerates_too_much_tears_it_loose(height: float, sticks: bool) -> None:
    motion = Motion(replace(REST, belt=ramp(height, duration=1.0)), 0.0, 0.0)
    motion.advance(1e-3)
    assert motion.sticking is sticks
    expected = 1e-3 * (height if sticks else 0.4 * np.sign(height))
    assert motion.velocity == pytest.approx(expected, rel=1e-6)


def test_signals_go_through_corners_at_the_samples_that_are_meant() -> None:
    rate = 1000.0
    for number in range(1, 400, 7):
        drive = replace(PAPER, belt=step(0.1, start=number / rate, duration=2.0 / rate))
        loop = SampledLoop(Motion(drive, 0.0, 0.0), rate, 0)
        speeds = [loop.sample.belt_velocity]
        speeds += [loop.advance().belt_velocity for _ in range(number + 3)]
        acting = [n for n, speed in enumerate(speeds) if speed == pytest.approx(0.5)]
        assert acting == [number, number + 1]


@pytest.mark.parametrize("belt", [sine(0.3, 0.1, 1.5, 2.0), trapezoid(0.3, 0.25, 1.0, 3.0)])
def test_the_belt_position_is_the_exact_integral(belt: Any) -> None:
    drive, rate = replace(PAPER, belt=belt), 100.0
    loop = SampledLoop(Motion(drive, 0.0, 0.0), rate, 0)
    for number in range(1, 201):
        sample = loop.advance()
        time = number / rate
        expected = drive.belt_speed * time + belt.integral(0.0, time)
        assert sample.belt_position == pytest.approx(expected, abs=1e-13)
        assert sample.belt_velocity == pytest.approx(drive.belt_speed + belt.at(time), abs=1e-12)


def test_a_reset_continues_the_signals_and_a_segment_starts_them() -> None:
    drive = replace(REST, belt=ramp(1.0, duration=10.0))
    motion = Motion(drive, 0.0, 0.0)
    motion.advance(2.0)
    motion.restart(0.0, 0.0)
    assert motion.belt_speed == pytest.approx(0.2)
    motion.drive = replace(drive, mass=2.0)
    assert motion.belt_speed == pytest.approx(0.2)
    SampledLoop(motion, 10.0, 0)
    assert motion.belt_speed == 0.0
    motion.advance(1.0)
    assert motion.belt_speed == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("load", "time"),
    [(ramp(-2.0, duration=4.0), 2.0), (step(-1.1, start=1.5), 1.5), (step(-1.1), 0.0)],
)
@pytest.mark.parametrize("velocity", [0.0, 0.4])
def test_a_load_that_lifts_the_slide_ends_the_run(
    load: Signal, time: float, velocity: float
) -> None:
    with pytest.raises(RunError, match=f"the normal force falls below 0 N at {time:g}"):
        Motion(replace(PAPER, load=load), 0.0, velocity).advance(5.0)


def test_a_load_may_take_all_of_the_normal_force() -> None:
    motion = Motion(replace(REST, load=trapezoid(-1.0, 1.0, 4.0, 1.0)), 0.1, 0.0)
    motion.advance(3.0)
    assert not motion.sticking
    motion.advance(20.0)


def test_a_fast_belt_with_a_narrow_exponential() -> None:
    """The integration sees the friction near zero speed although it is negligible elsewhere."""
    numbers = (0.4, 0.1, 0.003, 0.0, 1.0)
    law, curve = Exponential(*numbers), dop853.exponential(*numbers)
    plain = replace(PAPER, friction=law, belt_speed=0.0)
    belt = RandomSignal("ramp", {"amplitude": 0.5, "start": 1.0, "duration": 6.0})
    drive = RandomDrive(plain, curve, curve, belt, NONE, NONE, 0.0, 0.0)
    check(drive, 4.0)


def test_a_far_corner_costs_no_accuracy() -> None:
    """The margin of a corner does not count in the tolerance of the integration."""
    near = replace(PAPER, belt=step(0.1, start=500.0))
    far = replace(PAPER, belt=step(0.1, start=1e9))
    found: list[tuple[float, float]] = []
    for drive in (PAPER, near, far):
        motion = Motion(drive, 0.1, 0.0)
        motion.advance(60.0)
        found.append((motion.position, motion.velocity))
    assert found[1] == pytest.approx(found[0], abs=1e-12)
    assert found[2] == pytest.approx(found[0], abs=1e-12)
