"""References over time: values, derivatives, corners, refusals."""

from math import inf, nan, pi

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stickslip_ros.physics.loop.reference import ReferenceCourse, ReferenceKind
from stickslip_ros.physics.model.control import NO_REFERENCE, Reference
from tests.examples import examples

AT_REST = Reference(0.0, 0.0, 0.0)
SHAPES = [ReferenceKind.STEP, ReferenceKind.RAMP, ReferenceKind.SINE, ReferenceKind.TRAPEZOID]
STEP = 1e-4


@st.composite
def courses(draw: st.DrawFn) -> ReferenceCourse:
    course = ReferenceCourse(
        draw(st.sampled_from(SHAPES)),
        amplitude=draw(st.floats(-2.0, 2.0)),
        start=draw(st.floats(0.0, 2.0)),
        duration=draw(st.floats(0.1, 5.0)),
        frequency=draw(st.floats(0.1, 20.0)),
    )
    assume(course.refusal() is None)
    return course


def corners(course: ReferenceCourse) -> list[float]:
    rise = 1.0 / course.frequency
    return [course.start + t for t in (0.0, rise, course.duration - rise, course.duration)]


def values(course: ReferenceCourse, time: float) -> tuple[float, float, float]:
    position, velocity, acceleration = course(time)
    assert position is not None
    assert velocity is not None
    assert acceleration is not None
    return position, velocity, acceleration


@given(courses(), st.floats(-0.2, 1.2))
@examples(quick=50, thorough=500)
def test_velocity_and_acceleration_are_derivatives(course: ReferenceCourse, share: float) -> None:
    time = course.start + share * course.duration
    assume(all(abs(time - corner) > 2.0 * STEP for corner in corners(course)))
    before, now, after = (values(course, time + h) for h in (-STEP, 0.0, STEP))
    # Central differences, with the largest third derivative of the sine.
    error = abs(course.amplitude) * (2.0 * pi * course.frequency) ** 3 * STEP**2 + 1e-9
    assert now[1] == pytest.approx((after[0] - before[0]) / (2.0 * STEP), abs=error)
    error = error * 2.0 * pi * course.frequency + 1e-9
    assert now[2] == pytest.approx((after[1] - before[1]) / (2.0 * STEP), abs=error)


@given(courses(), st.floats(-1.0, 8.0))
def test_it_stays_within_its_amplitude_and_rests_before_and_after(
    course: ReferenceCourse, time: float
) -> None:
    position, velocity, acceleration = values(course, time)
    assert abs(position) <= abs(course.amplitude) * (1.0 + 1e-12)
    if time < course.start:
        assert course(time) == AT_REST
    elif time >= course.start + course.duration + 1e-9:
        kept = course.amplitude if course.kind is ReferenceKind.RAMP else 0.0
        assert (position, velocity, acceleration) == (kept, 0.0, 0.0)


@given(courses())
def test_only_a_step_and_the_end_of_a_sine_jump(course: ReferenceCourse) -> None:
    assume(course.kind in (ReferenceKind.RAMP, ReferenceKind.TRAPEZOID))
    for corner in corners(course):
        before, after = values(course, corner - 1e-9), values(course, corner + 1e-9)
        assert before[0] == pytest.approx(after[0], abs=1e-6)


def test_a_corner_has_the_derivatives_after_it() -> None:
    trapezoid = ReferenceCourse(ReferenceKind.TRAPEZOID, 0.5, 1.0, 8.0, frequency=0.5)
    found = [trapezoid(time) for time in (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 8.0, 9.0, 20.0)]
    assert found == [
        AT_REST,
        Reference(0.0, 0.25, 0.0),
        Reference(0.25, 0.25, 0.0),
        Reference(0.5, 0.0, 0.0),
        Reference(0.5, 0.0, 0.0),
        Reference(0.5, -0.25, 0.0),
        Reference(0.25, -0.25, 0.0),
        AT_REST,
        AT_REST,
    ]


def test_shapes() -> None:
    step = ReferenceCourse(ReferenceKind.STEP, 0.5, 1.0, 2.0)
    assert [step(t).position for t in (0.5, 1.0, 2.9, 3.0)] == [0.0, 0.5, 0.5, 0.0]
    assert {step(t)[1:] for t in (0.5, 1.0, 2.9, 3.0)} == {(0.0, 0.0)}
    endless = ReferenceCourse(ReferenceKind.SINE, 0.5, frequency=0.25)
    assert endless(1.0) == pytest.approx(Reference(0.5, 0.0, -0.125 * pi**2))
    assert endless(0.0) == pytest.approx(Reference(0.0, 0.25 * pi, 0.0))
    ramp = ReferenceCourse(ReferenceKind.RAMP, 0.5, 1.0, 2.0)
    assert ramp(2.0) == Reference(0.25, 0.25, 0.0)
    assert ramp(3.0) == Reference(0.5, 0.0, 0.0)


@pytest.mark.parametrize("kind", [ReferenceKind.NONE, ReferenceKind.TOPIC])
@given(st.floats(-1.0, 1e9))
def test_without_a_course_there_is_no_reference(kind: ReferenceKind, time: float) -> None:
    course = ReferenceCourse(kind, amplitude=1.0)
    assert course.refusal() is None
    assert course(time) is NO_REFERENCE


@pytest.mark.parametrize("duration", [inf, 0.0, -1.0, nan])
@pytest.mark.parametrize("kind", [ReferenceKind.RAMP, ReferenceKind.TRAPEZOID])
def test_a_rise_needs_a_duration(kind: ReferenceKind, duration: float) -> None:
    refusal = ReferenceCourse(kind, 1.0, duration=duration).refusal()
    assert refusal == f"duration = {duration} s: must be above 0 and finite for a {kind}"


def test_a_trapezoid_has_the_time_to_rise_and_fall() -> None:
    refusal = ReferenceCourse(ReferenceKind.TRAPEZOID, 1.0, duration=0.9, frequency=2.0).refusal()
    assert refusal == "duration = 0.9 s: must be at least 2/frequency = 1 s for a trapezoid"
    triangle = ReferenceCourse(ReferenceKind.TRAPEZOID, 1.0, duration=1.0, frequency=2.0)
    assert triangle.refusal() is None
    assert triangle(0.25).position == triangle(0.75).position == 0.5


@pytest.mark.parametrize("kind", [ReferenceKind.STEP, ReferenceKind.SINE])
@pytest.mark.parametrize("duration", [inf, 0.0])
def test_a_step_and_a_sine_last_any_time(kind: ReferenceKind, duration: float) -> None:
    assert ReferenceCourse(kind, 1.0, duration=duration).refusal() is None
