"""Properties of the motion of random drives: laws with and without memory, signals, control."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import nextafter
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.constants import Scales
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_system import DriveSystem
from stickslip_ros.model.friction import (
    Coulomb,
    Dahl,
    Directional,
    Exponential,
    FrictionLaw,
    Linear,
    MaxwellSlip,
    Stribeck,
    Table,
)
from stickslip_ros.model.hybrid import HybridSystem, Instant
from stickslip_ros.model.signals import NO_SIGNAL, Signal, ramp, sine
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.breakpoint_recorder import BreakpointRecorder
from stickslip_ros.motion.compiled_flow import parameter_values
from stickslip_ros.motion.phase import Phase
from tests.examples import examples

LAWS: list[FrictionLaw] = [
    Stribeck(0.4, 0.25, 0.5),
    Coulomb(0.4),
    Linear(0.4, 0.1),
    Exponential(0.4, 0.25, 0.5, 0.05),
    Directional(Coulomb(0.3), Coulomb(0.6)),
    Table(((0.0, 0.4), (0.5, 0.28))),
    Dahl(0.4, 20.0),
    MaxwellSlip(Coulomb(0.4), 20.0, elements=2, attraction=5.0),
]
SIGNALS: list[tuple[Signal, Signal]] = [
    (NO_SIGNAL, NO_SIGNAL),
    (sine(0.1, frequency=0.2), NO_SIGNAL),
    (NO_SIGNAL, sine(0.3, frequency=0.1)),
    (ramp(0.1, 1.0, 2.0), ramp(0.4, 1.0, 2.0)),
]
GAINS = Washout(0.5, -0.1, -0.05)


def above_denormal(number: float) -> float:
    """Return 0 for a speed at which the time of an event is a denormal number."""
    return number if abs(number) > 1e-100 else 0.0


class Case(NamedTuple):
    """A random drive, with its start and its control; SI units."""

    drive: Drive
    position: float
    velocity: float
    control: Washout | None

    def motion(self, kind: type[Motion] = Motion) -> Motion:
        return kind(self.drive, self.position, self.velocity, self.control)

    def dimensionless(self, motion: Motion) -> tuple[float, float]:
        drive = self.drive
        return motion.position / drive.length_scale, motion.velocity / drive.speed_scale


def drive_of(
    law: FrictionLaw,
    belt_speed: float,
    signals: tuple[Signal, Signal] = SIGNALS[0],
    damping: float = 0.05,
    scales: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Drive:
    """Return the drive in SI units that is this one, dimensionless; scales are m, k and N."""
    mass, stiffness, normal = scales
    unit = Drive(mass, 0.0, stiffness, normal, 0.0, law).scales
    back = Scales(1.0 / unit.length, 1.0 / unit.speed, 1.0 / unit.force)
    return Drive(
        mass,
        damping * (stiffness * mass) ** 0.5,
        stiffness,
        normal,
        belt_speed * unit.speed,
        law.scaled(back.speed, back.length),
        signals[0].scaled(back, "m/s"),
        signals[1].scaled(back, "N"),
    )


def in_units_of(drive: Drive, control: Washout) -> Washout:
    """Return the gains in SI units that are these ones, dimensionless."""
    back = drive.normal_force / drive.speed_scale
    return Washout(
        control.corner_frequency * drive.angular_frequency,
        control.linear_gain * back,
        control.cubic_gain * back / drive.speed_scale**2,
    )


@st.composite
def cases(draw: st.DrawFn) -> Case:
    belt_speed = draw(st.sampled_from([-0.4, 0.0, 0.3]) | st.floats(-1.0, 1.0))
    drive = drive_of(
        draw(st.sampled_from(LAWS)),
        belt_speed,
        draw(st.sampled_from(SIGNALS)),
        draw(st.sampled_from([0.0, 0.05, 0.3])),
        draw(st.sampled_from([(1.0, 1.0, 1.0), (100.0, 1e6, 1000.0), (0.5, 7e3, 2.0)])),
    )
    velocity = draw(st.just(belt_speed) | st.floats(-1.0, 1.0).map(above_denormal))
    position = draw(st.floats(-1.0, 1.0))
    control = draw(st.sampled_from([None, GAINS]))
    length, speed = drive.length_scale, drive.speed_scale
    control = None if control is None else in_units_of(drive, control)
    return Case(drive, position * length, velocity * speed, control)


def close(case: Case, one: Motion, other: Motion) -> None:
    assert case.dimensionless(one) == pytest.approx(case.dimensionless(other), abs=1e-9)


POWER = Exponential(1.0, 0.0, 1.0, 0.1, exponent=1.5)
TURNING = Case(Drive(1.0, 0.0, 1.0, 1.0, 0.0, POWER), 2.0, 1.0, None)
"""The power of the relative speed has no series at zero, where the slide turns."""
STARTING = TURNING._replace(drive=replace(TURNING.drive, belt_speed=1.0))
SUDDEN = Case(Drive(1.0, 0.0, 1.0, 1.0, 1.0, Exponential(1.0, 0.0, 0.21875, -0.5)), 0.0, 1.0, None)
"""Friction rises within a hundredth of the time that the rest of the motion takes to change."""
ROUNDED = Case(Drive(1.0, 0.0, 1e8, 1.0, 0.0, Stribeck(1.0, 0.0, 1e-4)), 0.0, 0.0, None)
"""Time is the sum of the steps, and a breakpoint of the next may follow at once."""


@given(cases(), st.lists(st.floats(0.0, 1.0), max_size=4))
@example(TURNING, [])
@example(STARTING, [])
@example(SUDDEN, [])
@example(ROUNDED, [0.71875, 2.2250738585e-313])
@examples(quick=25, thorough=60)
def test_cutting_a_motion_anywhere_changes_nothing(case: Case, cuts: list[float]) -> None:
    duration = 5.0 / case.drive.angular_frequency
    whole, cut = case.motion(RecordedMotion), case.motion(RecordedMotion)
    whole.advance(duration)
    times = whole.take_breakpoints().time.tolist()
    ends = sorted([*(duration * share for share in cuts), *times[:6], *times[:2], duration])
    for before, after in pairwise([0.0, *ends]):
        cut.advance(after - before)
    close(case, cut, whole)
    assert np.all(np.diff(cut.take_breakpoints().time) >= 0.0)


@given(cases())
@examples(quick=15, thorough=30)
def test_a_plain_drive_moves_as_any_other(case: Case) -> None:
    """The quick system of a plain drive, recorded or not, and the general one move alike."""
    quick, recorded = case.motion(), case.motion(RecordedMotion)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("stickslip_ros.motion.motion.drive_system", DriveSystem)
        general = case.motion()
    for _ in range(8):
        for motion in (quick, recorded, general):
            motion.advance(1.0 / case.drive.angular_frequency)
        close(case, recorded, quick)
        close(case, quick, general)
        assert quick.sticking == general.sticking


@given(cases(), cases())
@examples(quick=15, thorough=30)
def test_motions_do_not_disturb_each_other(case: Case, other: Case) -> None:
    def run(one: Case, between: Callable[[], object] = lambda: None) -> tuple[float, float]:
        motion = one.motion()
        for _ in range(5):
            motion.advance(1.0 / one.drive.angular_frequency)
            between()
        return motion.position, motion.velocity

    alone = run(case), run(other)
    again = case._replace(position=0.5 * case.position)
    assert run(case, lambda: run(again)) == alone[0]
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(run, [case, other] * 3)) == [*alone] * 3


@given(cases())
@examples(quick=25, thorough=60)
def test_time_never_goes_back_and_there_is_no_endless_chatter(case: Case) -> None:
    check_phases(case)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("belt_speed", [-0.4, 0.0, 0.3])
def test_nor_from_a_guard(law: FrictionLaw, belt_speed: float) -> None:
    forward, backward = law.limits
    drive = drive_of(law, belt_speed)
    for limit in (-forward, 0.0, backward):
        at = limit - 0.05 * belt_speed
        for position in (at, nextafter(at, 9.0), nextafter(at, -9.0)):
            check_phases(Case(drive, position, belt_speed, None))


@pytest.mark.parametrize("start", [0.0, 1.0, nextafter(1.0, 0.0), 3.0])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_nor_from_a_corner(law: FrictionLaw, start: float) -> None:
    drive = drive_of(law, 0.3, (ramp(0.1, 1.0, 2.0), ramp(0.4, 1.0, 2.0)))
    motion = Motion(drive, 0.1, 0.2)
    motion.advance(start)
    check_phases(Case(drive, motion.position, motion.velocity, None))


class Counter:
    """Counts phases, whose ends must not go back, and passes them on to a recorder."""

    def __init__(self, recorder: BreakpointRecorder) -> None:
        self.begin, self.start = recorder.begin, recorder.start
        self._recorder, self._reached, self.phases = recorder, 0.0, 0

    def take(self, phase: Phase, system: DriveSystem, instant: Instant) -> None:
        self._recorder.take(phase, system, instant)
        assert self._reached <= phase.end
        self._reached = phase.end
        self.phases += 1


def check_phases(case: Case) -> None:
    """Check the phases of ten natural periods."""
    motion = case.motion(RecordedMotion)
    motion.core.observer = counter = Counter(motion.recorder)
    motion.advance(10.0 * case.drive.natural_period)
    assert counter.phases < 1000
    times = motion.take_breakpoints().time
    assert np.all(np.diff(times) >= 0.0)
    if not motion.unbounded:
        assert times[-1] == pytest.approx(10.0 * case.drive.natural_period, rel=1e-12)


@cache
def _margins(structure: int, flow: str, system: HybridSystem) -> Any:
    margins = [guard.margin for guard in system.shared_flow(flow).guards]
    return hy.cfunc([hy.expression(0.0) + each for each in margins], list(system.variables))


def margins_of(motion: Motion, time: float) -> FloatArray:
    """Return the margins of the guards of the present mode, from the description."""
    system, mode, instant = motion.core.system, motion.core.mode, motion.core.instant
    compiled = _margins(system.structure, mode.flow, system)
    parameters = parameter_values(system, mode, instant.inputs)
    timed = {"time": time} if compiled.is_time_dependent else {}
    return compiled(np.array(instant.state), pars=parameters[: compiled.nparams], **timed)


@given(cases())
@examples(quick=15, thorough=30)
def test_no_guard_is_passed_over(case: Case) -> None:
    motion = case.motion()
    omega = case.drive.angular_frequency
    for number in range(1, 201):
        motion.advance(0.05 / omega)
        if motion.unbounded:
            break
        assert margins_of(motion, 0.05 * number).min() > -1e-9, number


NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@given(cases())
@examples(quick=10, thorough=30)
def test_the_energy_gained_is_the_work_done(case: Case) -> None:
    drive, duration = case.drive, 5.0 / case.drive.angular_frequency
    recorded = case.motion(RecordedMotion)
    recorded.advance(duration)
    corners = np.clip(recorded.take_breakpoints().time, 0.0, duration)
    ends = np.unique([*corners, *np.linspace(0.0, duration, 201)])
    motion, time, work = case.motion(), 0.0, 0.0
    for before, after in pairwise(ends.tolist()):
        for node, weight in zip((1.0 + NODES) / 2.0, WEIGHTS / 2.0, strict=True):
            instant = before + node * (after - before)
            motion.advance(instant - time)
            time, speed = instant, motion.velocity
            force = motion.friction_force + motion.applied_force - drive.damping * speed
            if motion.sticking and drive.load == NO_SIGNAL:
                limit = max(drive.friction.limits)
                assert abs(motion.friction_force) <= limit * drive.normal_force * (1.0 + 1e-12)
            if not drive.friction.states:  # it dissipates
                assert motion.friction_force * (speed - motion.belt_speed) <= 0.0
            work += weight * (after - before) * force * speed
    motion.advance(duration - time)
    energies = [
        (drive.stiffness * x * x + drive.mass * v * v) / 2.0
        for x, v in ((case.position, case.velocity), (motion.position, motion.velocity))
    ]
    unit = drive.stiffness * drive.length_scale**2
    assert (energies[1] - energies[0]) / unit == pytest.approx(work / unit, abs=1e-8)
