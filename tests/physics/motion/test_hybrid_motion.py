"""Properties of the motion of random drives: laws with and without memory, courses, control."""

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
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.constants import Scales, scaled
from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.model.course import NO_COURSE, Course
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import DriveSystem
from stickslip_ros.physics.model.friction import (
    Coulomb,
    Exponential,
    FrictionLaw,
    Linear,
    Stribeck,
)
from stickslip_ros.physics.model.hybrid import HybridSystem, Mode
from stickslip_ros.physics.motion import Motion, RecordedMotion, compiled_flow
from stickslip_ros.physics.motion.derivatives import parameter_values
from stickslip_ros.physics.motion.variational import SensitiveMotion
from tests.examples import examples
from tests.physics.courses import above_denormal
from tests.physics.parts import Dahl, Iwan, OneSided, Pieces, Ramp, Swing

LAWS: list[FrictionLaw] = [
    Stribeck(0.4, 0.25, 0.5),
    Coulomb(0.4),
    Linear(0.4, 0.1),
    Exponential(0.4, 0.25, 0.5, 0.05),
    OneSided(static=0.3),
    Pieces(static=0.4),
    Dahl(static=0.4),
    Iwan(static=0.4),
]
COURSES: list[tuple[Course, Course]] = [
    (NO_COURSE, NO_COURSE),
    (Swing(0.1, 0.2), NO_COURSE),
    (NO_COURSE, Swing(0.3, 0.1)),
    (Ramp(), Ramp(0.4)),
]
GAINS = WashoutGains(0.5, -0.1, -0.05)


class Case(NamedTuple):
    """A random drive, with its start and its control; SI units."""

    drive: Drive
    position: float
    velocity: float
    control: WashoutGains | None

    def motion(self, kind: type[Motion] = Motion) -> Motion:
        return kind(self.drive, self.position, self.velocity, self.control)

    def dimensionless(self, motion: Motion) -> tuple[float, float]:
        drive = self.drive
        return motion.position / drive.length_scale, motion.velocity / drive.speed_scale


def drive_of(
    law: FrictionLaw,
    belt_speed: float,
    courses: tuple[Course, Course] = COURSES[0],
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
        scaled(courses[0], back, "m/s"),
        scaled(courses[1], back, "N"),
    )


@st.composite
def cases(draw: st.DrawFn) -> Case:
    belt_speed = draw(st.sampled_from([-0.4, 0.0, 0.3]) | st.floats(-1.0, 1.0))
    drive = drive_of(
        draw(st.sampled_from(LAWS)),
        belt_speed,
        draw(st.sampled_from(COURSES)),
        draw(st.sampled_from([0.0, 0.05, 0.3])),
        draw(st.sampled_from([(1.0, 1.0, 1.0), (100.0, 1e6, 1000.0), (0.5, 7e3, 2.0)])),
    )
    velocity = draw(st.just(belt_speed) | st.floats(-1.0, 1.0).map(above_denormal))
    position = draw(st.floats(-1.0, 1.0))
    control = draw(st.sampled_from([None, GAINS]))
    length, speed = drive.length_scale, drive.speed_scale
    if control is not None:
        back = drive.normal_force / speed
        control = WashoutGains(
            control.corner_frequency * drive.angular_frequency,
            control.linear * back,
            control.cubic * back / speed**2,
        )
    return Case(drive, position * length, velocity * speed, control)


def close(case: Case, one: Motion, other: Motion) -> None:
    assert case.dimensionless(one) == pytest.approx(case.dimensionless(other), abs=1e-9)


@given(cases(), st.lists(st.floats(0.0, 1.0), max_size=4))
@examples(quick=25, thorough=400)
def test_cutting_a_motion_anywhere_changes_nothing(case: Case, cuts: list[float]) -> None:
    duration = 5.0 / case.drive.angular_frequency
    whole, cut = case.motion(RecordedMotion), case.motion()
    assert isinstance(whole, RecordedMotion)
    whole.advance(duration)
    times = whole.take_breakpoints().time.tolist()
    ends = sorted([*(duration * share for share in cuts), *times[:6], *times[:2], duration])
    for before, after in pairwise([0.0, *ends]):
        cut.advance(after - before)
    close(case, cut, whole)


@given(cases())
@examples(quick=15, thorough=300)
def test_recording_changes_nothing(case: Case) -> None:
    recorded, bare = case.motion(RecordedMotion), case.motion()
    for motion in (recorded, bare):
        motion.advance(8.0 / case.drive.angular_frequency)
    close(case, recorded, bare)


@given(cases())
@examples(quick=15, thorough=300)
def test_a_plain_drive_moves_as_any_other(case: Case) -> None:
    """The quick system of a plain drive and the general one describe the same motion."""
    quick = case.motion()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("stickslip_ros.physics.motion.motion.drive_system", DriveSystem)
        general = case.motion()
    for _ in range(8):
        for motion in (quick, general):
            motion.advance(1.0 / case.drive.angular_frequency)
        close(case, quick, general)
        assert quick.sticking == general.sticking


@given(cases())
@examples(quick=15, thorough=300)
def test_an_equal_drive_changes_nothing(case: Case) -> None:
    kept, changed = case.motion(), case.motion()
    for motion in (kept, changed):
        motion.advance(2.0 / case.drive.angular_frequency)
        if motion is changed:
            motion.drive = case.drive
        motion.advance(3.0 / case.drive.angular_frequency)
    close(case, changed, kept)


def test_a_change_of_the_drive_keeps_the_time_of_its_courses() -> None:
    drive = drive_of(LAWS[0], 0.3, (Ramp(height=0.1, start=1.0, duration=2.0), NO_COURSE))
    motion = Motion(drive, 0.0, 0.0)
    motion.advance(2.0)
    motion.drive = replace(drive, mass=16.0)
    assert motion.belt_speed == pytest.approx(0.35, rel=1e-12)


@given(cases(), cases())
@examples(quick=15, thorough=300)
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
@examples(quick=25, thorough=400)
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
    drive = drive_of(law, 0.3, (Ramp(), Ramp(0.4)))
    motion = Motion(drive, 0.1, 0.2)
    motion.advance(start)
    check_phases(Case(drive, motion.position, motion.velocity, None))


class Counted(RecordedMotion):
    """Counts its phases, whose ends must not go back."""

    phases = 0
    reached = 0.0

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        super()._pass(mode, guard, following, now)
        assert self.reached <= now
        self.reached = now
        self.phases += 1


def check_phases(case: Case) -> None:
    """Check the phases of ten natural periods."""
    motion = case.motion(Counted)
    assert isinstance(motion, Counted)
    motion.advance(10.0 * case.drive.natural_period)
    assert motion.phases < 1000
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
    system, mode = motion._system, motion._mode
    compiled = _margins(system.structure, mode.flow, system)
    parameters = parameter_values(system, mode, motion._instant.inputs)
    timed = {"time": time} if compiled.is_time_dependent else {}
    return compiled(np.array(motion._instant.state), pars=parameters[: compiled.nparams], **timed)


@given(cases())
@examples(quick=15, thorough=300)
def test_no_guard_is_passed_over(case: Case) -> None:
    motion = case.motion()
    omega = case.drive.angular_frequency
    for number in range(1, 201):
        motion.advance(0.05 / omega)
        if motion.unbounded:
            break
        assert margins_of(motion, 0.05 * number).min() > -1e-9, number


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_each_direction_has_its_limit(law: FrictionLaw) -> None:
    forward, backward = law.limits
    drive = drive_of(law, 0.0)
    for limit, inside in ((backward, -0.01), (-forward, 0.01)):
        assert Motion(drive, limit + inside, 0.0).sticking == (not law.states)
        assert not Motion(drive, limit - inside, 0.0).sticking


NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@given(cases())
@examples(quick=10, thorough=100)
def test_the_energy_gained_is_the_work_done(case: Case) -> None:
    drive, duration = case.drive, 5.0 / case.drive.angular_frequency
    recorded = case.motion(RecordedMotion)
    assert isinstance(recorded, RecordedMotion)
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
            work += weight * (after - before) * force * speed
    motion.advance(duration - time)
    energies = [
        (drive.stiffness * x * x + drive.mass * v * v) / 2.0
        for x, v in ((case.position, case.velocity), (motion.position, motion.velocity))
    ]
    unit = drive.stiffness * drive.length_scale**2
    assert (energies[1] - energies[0]) / unit == pytest.approx(work / unit, abs=1e-8)


def test_an_ended_motion_gives_its_integrator_back(monkeypatch: pytest.MonkeyPatch) -> None:
    Motion(drive_of(LAWS[0], 0.3), 0.0, 0.0).advance(5.0)
    monkeypatch.setattr(compiled_flow, "_compile", lambda *_: pytest.fail("compiles again"))
    Motion(drive_of(LAWS[0], 0.2), 0.0, 0.0).advance(5.0)


@pytest.mark.parametrize("law", LAWS[1:], ids=lambda law: law.name)
def test_transition_is_that_of_finite_differences(law: FrictionLaw) -> None:
    motion = SensitiveMotion(drive_of(law, 0.3))
    start = np.array([0.1, 0.5, *([0.001] * (motion.order - 2))])

    def end(state: FloatArray) -> FloatArray:
        motion.start(state)
        motion.advance(2.0)
        return motion.state

    columns = [(end(start + h) - end(start - h)) / 2e-6 for h in 1e-6 * np.eye(motion.order)]
    end(start)
    np.testing.assert_allclose(motion.transition, np.transpose(columns), rtol=1e-5, atol=1e-7)
