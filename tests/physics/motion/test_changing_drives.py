"""Belts and loads that change with time, against another integrator and closed forms."""

from dataclasses import replace
from itertools import pairwise
from math import cos, exp, inf, pi, sin
from typing import Any

import numpy as np
import pytest

from stickslip_ros.errors import RunError
from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.model.course import NO_COURSE, Course
from stickslip_ros.physics.model.courses import (
    COURSES,
    CourseKind,
    Impulse,
    Ramp,
    Sine,
    Step,
    Table,
    Trapezoid,
)
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Coulomb, Exponential, Stribeck
from stickslip_ros.physics.motion import Motion, RecordedMotion
from tests.physics.drives import PAPER
from tests.physics.motion.scipy_drive import Function, Piecewise, ScipyDrive

KINDS = [kind for kind in CourseKind if kind is not CourseKind.NONE]
PERIODS = 20
REST = Drive(1.0, 0.0, 1.0, 1.0, 0.0, Coulomb(0.4))


def zero(_: float) -> float:
    return 0.0


def pieces(course: Any, base: float) -> Piecewise:
    """Return base + course, written from the definitions of the courses."""

    def level(value: float) -> tuple[Function, Function]:
        return (lambda t: base + value), zero

    def line(start: float, before: float, end: float, after: float) -> tuple[Function, Function]:
        slope = (after - before) / (end - start)
        return (lambda t: base + before + slope * (t - start)), (lambda t: slope)

    if isinstance(course, Table):
        points = list(zip(course.times, course.values, strict=True))
        lines = [(a[0], *line(*a, *b)) for a, b in pairwise(points)]
        return Piecewise(
            [(-inf, *level(course.values[0])), *lines, (points[-1][0], *level(points[-1][1]))]
        )
    if course == NO_COURSE:
        return Piecewise([(-inf, *level(0.0))])
    height, start, end = course.amplitude, course.start, course.start + course.duration
    found: list[tuple[float, Function, Function]] = [(-inf, *level(0.0))]
    match course:
        case Step():
            found += [(start, *level(height)), (end, *level(0.0))]
        case Ramp():
            found += [(start, *line(start, 0.0, end, height)), (end, *level(height))]
        case Trapezoid(frequency=frequency):
            top, fall = start + 1.0 / frequency, end - 1.0 / frequency
            found += [
                (start, *line(start, 0.0, top, height)),
                (top, *level(height)),
                (fall, *line(fall, height, end, 0.0)),
                (end, *level(0.0)),
            ]
        case Sine(frequency=frequency):
            omega = 2.0 * pi * frequency
            found += [
                (
                    start,
                    lambda t: base + height * sin(omega * (t - start)),
                    lambda t: height * omega * cos(omega * (t - start)),
                ),
                (end, *level(0.0)),
            ]
        case _:
            raise AssertionError(course)
    return Piecewise(found)


def sizes(law: Any) -> Function:
    """Return the size of the coefficient over the speed, written from the definitions."""
    match law:
        case Coulomb(static=static):
            return lambda v: static
        case Exponential(static=static, kinetic=kinetic, decay_speed=decay, viscous=viscous):
            return lambda v: kinetic + (static - kinetic) * exp(-v / decay) + viscous * v
        case Stribeck(static=static, minimum=minimum, minimum_speed=speed):
            half = (static - minimum) / 2.0
            return lambda v: static - half * (3.0 * v / speed - (v / speed) ** 3)
    raise AssertionError(law)


def random_course(kind: CourseKind, size: float, drive: Drive, rng: np.random.Generator) -> Course:
    period = drive.natural_period
    amplitude = float(rng.uniform(0.2, 0.9) * rng.choice([-1.0, 1.0])) * size
    start, duration = rng.uniform(0.0, 5.0) * period, rng.uniform(1.0, 12.0) * period
    frequency = rng.uniform(0.1, 1.3) / period
    match kind:
        case CourseKind.RAMP:
            return Ramp(amplitude, start, duration)
        case CourseKind.SINE:
            return Sine(amplitude, start, duration, frequency)
        case CourseKind.TRAPEZOID:
            return Trapezoid(amplitude, start, duration + 2.0 / frequency, frequency)
        case CourseKind.TABLE:
            times = np.cumsum(rng.uniform(0.3, 4.0, 6)) * period
            return Table(tuple(times.tolist()), tuple((amplitude * rng.uniform(-1, 1, 6)).tolist()))
        case CourseKind.IMPULSE:
            return Impulse(amplitude, start).sampled(0.05 * period)
        case _:
            return Step(amplitude, start, duration)


def random_drive(seed: int, belt: CourseKind, load: CourseKind) -> tuple[Drive, float, float]:
    """Return a drive with its start, SI units."""
    rng = np.random.default_rng([seed, KINDS.index(belt) if belt in KINDS else 9, 7])
    mass, stiffness, normal = rng.uniform(0.5, 2.0, 3).tolist()
    unit = Drive(mass, 0.0, stiffness, normal, 0.0, Coulomb(0.4))
    speed = unit.speed_scale
    law = rng.choice(3)
    friction = [
        Coulomb(0.4),
        Exponential(0.4, 0.25, 0.4 * speed, 0.02 / speed),
        Stribeck(0.4, 0.25, 0.6 * speed),
    ][law]
    drive = replace(
        unit,
        damping=float(rng.uniform(0.0, 0.1)) * (stiffness * mass) ** 0.5,
        belt_speed=float(rng.choice([0.0, 0.1, 0.3, -0.2])) * speed,
        friction=friction,
    )
    if belt is not CourseKind.NONE:
        drive = replace(drive, belt=random_course(belt, 0.4 * speed, drive, rng))
    if load is not CourseKind.NONE:
        drive = replace(drive, load=random_course(load, normal, drive, rng))
    length = drive.length_scale
    return drive, float(rng.uniform(-1.0, 1.0)) * length, float(rng.uniform(-0.5, 0.5)) * speed


def error(drive: Drive, position: float, velocity: float, periods: float = PERIODS) -> float:
    """Return the largest difference from scipy's motion, in shares of the motion's scale."""
    times = np.linspace(0.0, periods * drive.natural_period, 101)[1:]
    reference = ScipyDrive(
        drive.mass,
        drive.damping,
        drive.stiffness,
        sizes(drive.friction),
        pieces(drive.load, drive.normal_force),
        pieces(drive.belt, drive.belt_speed),
    )
    expected = reference.run(position, velocity, times)
    motion, now = Motion(drive, position, velocity), 0.0
    found: list[tuple[float, float]] = []
    for time in times.tolist():
        motion.advance(time - now)
        now = time
        found.append((motion.position, motion.velocity))
    least = 1e-3 * np.array([drive.length_scale, drive.speed_scale])  # of a slide that rests
    scale = np.maximum(np.abs(expected).max(axis=0), least)
    return float((np.abs(np.array(found) - expected) / scale).max())


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("part", ["belt", "load", "both"])
def test_motions_are_those_of_another_integrator(part: str, kind: CourseKind, seed: int) -> None:
    other = KINDS[(KINDS.index(kind) + seed) % len(KINDS)]
    belt = kind if part != "load" else CourseKind.NONE
    load = {"belt": CourseKind.NONE, "load": kind, "both": other}[part]
    assert error(*random_drive(seed, belt, load)) < 1e-7


def release(motion: Motion, longest: float) -> float:
    """Return the time at which a sticking slide breaks loose, from the first change of mode."""
    assert isinstance(motion, RecordedMotion)
    assert motion.sticking
    motion.advance(longest)
    found = motion.take_breakpoints()
    slipping = np.flatnonzero(~found.sticking[1:])
    return float(found.time[slipping[0]])


def test_a_slide_on_an_accelerating_belt_feels_its_inertia() -> None:
    """It sticks while m a + k a t^2/2 is below the friction that holds it."""
    acceleration = 0.1
    belt = Ramp(amplitude=1.0, duration=1.0 / acceleration)
    motion = RecordedMotion(replace(REST, belt=belt), 0.0, 0.0)
    held = 0.4 - acceleration
    assert release(motion, 5.0) == pytest.approx((2.0 * held / acceleration) ** 0.5, abs=1e-9)


@pytest.mark.parametrize(("height", "sticks"), [(0.39, True), (0.41, False), (-0.41, False)])
def test_a_belt_that_accelerates_too_much_tears_it_loose(height: float, sticks: bool) -> None:
    motion = Motion(replace(REST, belt=Ramp(height, duration=1.0)), 0.0, 0.0)
    motion.advance(1e-3)
    assert motion.sticking is sticks
    expected = 1e-3 * (height if sticks else 0.4 * np.sign(height))
    assert motion.velocity == pytest.approx(expected, rel=1e-6)


def test_a_falling_load_tears_a_slide_loose() -> None:
    drive = replace(REST, load=Ramp(-1.0, start=1.0, duration=4.0))
    motion = RecordedMotion(drive, 0.1, 0.0)
    assert release(motion, 5.0) == pytest.approx(1.0 + 4.0 * 0.75, abs=1e-9)


def test_a_load_and_an_accelerating_belt_together() -> None:
    """Broken loose where 0.05 (1 + t^2/2) reaches 0.4 (1 - t/10)."""
    drive = replace(REST, belt=Ramp(1.0, duration=20.0), load=Ramp(-0.8, duration=8.0))
    motion = RecordedMotion(drive, 0.0, 0.0)
    expected = (-0.04 + (0.04**2 + 4.0 * 0.025 * 0.35) ** 0.5) / (2.0 * 0.025)
    assert release(motion, 5.0) == pytest.approx(expected, abs=1e-9)


def test_a_step_of_the_belt_tears_a_sticking_slide_loose() -> None:
    drive = replace(REST, belt_speed=0.1, belt=Step(0.2, start=0.5))
    motion = RecordedMotion(drive, 0.0, 0.1)
    assert release(motion, 0.6) == pytest.approx(0.5, abs=1e-12)
    assert motion.belt_speed == pytest.approx(0.3)


@pytest.mark.parametrize(
    "load", [NO_COURSE, Sine(0.05, frequency=3.0), Trapezoid(0.5, duration=9.0, frequency=0.5)]
)
def test_stick_is_stick(load: Course) -> None:
    """On a belt at rest under 0.9 of the break-away force of the smallest normal force."""
    drive = replace(REST, load=load)
    motion = Motion(drive, 0.0, 0.0)
    motion.force = 0.9 * 0.4 * (1.0 + load.bounds[0])
    for _ in range(4):
        motion.advance(900.0)
        assert motion.sticking
        assert motion.position == 0.0


def test_a_feed_from_rest_and_back() -> None:
    """A trapezoid of the belt speed: the slide starts at rest, and ends at rest on the belt."""
    drive = replace(REST, damping=0.3, belt=Trapezoid(0.2, 1.0, 40.0, 0.2))
    motion = RecordedMotion(drive, 0.0, 0.0)
    motion.advance(100.0)
    assert motion.sticking
    assert motion.velocity == 0.0


def test_courses_go_through_corners_at_the_samples_that_are_meant() -> None:
    rate = 1000.0
    for number in range(1, 400, 7):
        drive = replace(PAPER, belt=Step(0.1, start=number / rate, duration=2.0 / rate))
        loop = SampledLoop(Motion(drive, 0.0, 0.0), rate, 0)
        speeds = [loop.sample.belt_velocity]
        speeds += [loop.advance().belt_velocity for _ in range(number + 3)]
        acting = [n for n, speed in enumerate(speeds) if speed == pytest.approx(0.5)]
        assert acting == [number, number + 1]


@pytest.mark.parametrize("belt", [Sine(0.3, 0.1, 1.5, 2.0), Trapezoid(0.3, 0.25, 1.0, 3.0)])
def test_the_belt_position_is_the_exact_integral(belt: Any) -> None:
    drive, rate = replace(PAPER, belt=belt), 100.0
    loop = SampledLoop(Motion(drive, 0.0, 0.0), rate, 0)
    for number in range(1, 201):
        sample = loop.advance()
        time = number / rate
        expected = drive.belt_speed * time + belt.integral(0.0, time)
        assert sample.belt_position == pytest.approx(expected, abs=1e-13)
        assert sample.belt_velocity == pytest.approx(drive.belt_speed + belt.at(time), abs=1e-12)


def test_a_reset_continues_the_courses_and_a_segment_starts_them() -> None:
    drive = replace(REST, belt=Ramp(1.0, duration=10.0))
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


def test_a_constant_belt_gets_a_course_while_it_moves() -> None:
    motion = Motion(PAPER, 0.0, 0.0)
    motion.advance(3.0)
    motion.drive = replace(PAPER, belt=Ramp(0.1, start=2.0, duration=4.0))
    assert motion.belt_speed == pytest.approx(0.4 + 0.1 * 0.25)


@pytest.mark.parametrize(
    ("load", "time"),
    [(Ramp(-2.0, duration=4.0), 2.0), (Step(-1.1, start=1.5), 1.5), (Step(-1.1), 0.0)],
)
@pytest.mark.parametrize("velocity", [0.0, 0.4])
def test_a_load_that_lifts_the_slide_ends_the_run(
    load: Course, time: float, velocity: float
) -> None:
    with pytest.raises(RunError, match=f"the normal force falls below 0 N at {time:g}"):
        Motion(replace(PAPER, load=load), 0.0, velocity).advance(5.0)


def test_a_load_may_take_all_of_the_normal_force() -> None:
    motion = Motion(replace(REST, load=Trapezoid(-1.0, 1.0, 4.0, 1.0)), 0.1, 0.0)
    motion.advance(3.0)
    assert not motion.sticking
    motion.advance(20.0)


def test_a_fast_belt_with_a_narrow_exponential() -> None:
    """The integration sees the friction near zero speed although it is negligible elsewhere."""
    drive = replace(
        PAPER, friction=Exponential(0.4, 0.1, 0.003), belt_speed=0.0, belt=Ramp(0.5, 1.0, 6.0)
    )
    assert error(drive, 0.0, 0.0, periods=4.0) < 1e-7


def test_every_kind_is_tested() -> None:
    assert {"none", *KINDS} == set(COURSES)


def test_a_far_corner_costs_no_accuracy() -> None:
    """The margin of a corner does not count in the tolerance of the integration."""
    near = replace(PAPER, belt=Step(0.1, start=500.0))
    far = replace(PAPER, belt=Step(0.1, start=1e9))
    found: list[tuple[float, float]] = []
    for drive in (PAPER, near, far):
        motion = Motion(drive, 0.1, 0.0)
        motion.advance(60.0)
        found.append((motion.position, motion.velocity))
    assert found[1] == pytest.approx(found[0], abs=1e-12)
    assert found[2] == pytest.approx(found[0], abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_energy_is_the_work_of_friction_and_damping(seed: int) -> None:
    """The works of a moving belt and of a changing load are in that of the friction force."""
    belt, load = KINDS[seed + 2], KINDS[-1 - seed]
    drive, position, velocity = random_drive(seed, belt, load)
    duration = 5.0 * drive.natural_period
    recorded, motion = (kind(drive, position, velocity) for kind in (RecordedMotion, Motion))
    recorded.advance(duration)
    corners = [start for part in (drive.belt, drive.load) for start in pieces(part, 0.0).starts]
    steps = np.linspace(0.0, duration, 200)
    times = np.unique([*recorded.take_breakpoints().time, *corners, *steps])
    times = times[(times >= 0.0) & (times <= duration)]
    nodes, weights = np.polynomial.legendre.leggauss(8)

    def energy() -> float:
        kinetic = drive.mass * motion.velocity**2
        return 0.5 * (kinetic + drive.stiffness * motion.position**2)

    before, work, now = energy(), 0.0, 0.0
    for start, end in pairwise(times.tolist()):
        half = 0.5 * (end - start)
        for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True):
            time = start + half * (1.0 + node)
            motion.advance(time - now)
            now = time
            force = motion.friction_force - drive.damping * motion.velocity
            work += half * weight * force * motion.velocity
    motion.advance(duration - now)
    scale = drive.normal_force * drive.length_scale
    assert (energy() - before) / scale == pytest.approx(work / scale, abs=1e-9)
