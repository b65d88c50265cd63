"""References over time: values, derivatives, corners, refusals."""

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.physics.loop.reference import ReferenceCourse, ReferenceKind
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.control import NO_REFERENCE, Reference
from stickslip_ros.physics.model.courses import Ramp, Sine, Step

AT_REST = Reference(0.0, 0.0, 0.0)


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


def test_it_is_a_course_with_its_rates() -> None:
    for course in (Step(2.0, 0.5, 1.0), Ramp(2.0, 0.5, 1.0), Sine(2.0, 0.5, 1.0, 3.0)):
        constants = [getattr(course, name) for name in constants_of(type(course))]
        reference = ReferenceCourse(ReferenceKind(course.name), *constants)
        assert reference.refusal() is None
        for time in (0.0, 0.5, 0.7, 1.5, 9.0):
            assert reference(time) == Reference(course.at(time), *course.rates(time))
    refusal = ReferenceCourse(ReferenceKind.TRAPEZOID, 1.0, duration=0.9, frequency=2.0).refusal()
    assert refusal == "duration = 0.9 s: must be at least 2/frequency = 1 s for a trapezoid"
