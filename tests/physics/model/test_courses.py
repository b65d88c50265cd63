"""Courses: values, corners, derivatives, integrals, bounds and refusals, from their definitions."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import cos, inf, nan, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from stickslip_ros.physics.model.constants import Scales, scaled
from stickslip_ros.physics.model.course import NO_COURSE
from stickslip_ros.physics.model.courses import (
    Impulse,
    PiecewiseCourse,
    Ramp,
    Sine,
    Step,
    Table,
    Trapezoid,
)
from tests.examples import examples

INCREASING = st.lists(st.integers(-20, 60), min_size=1, max_size=6, unique=True).map(sorted)


@st.composite
def courses(draw: st.DrawFn) -> PiecewiseCourse:
    amplitude, start = draw(st.floats(-2.0, 2.0)), draw(st.just(0.0) | st.floats(0.0, 3.0))
    duration, frequency = draw(st.floats(0.1, 5.0)), draw(st.floats(0.1, 3.0))
    kind = draw(st.sampled_from([Step, Impulse, Ramp, Sine, Trapezoid, Table]))
    if kind is Sine:
        return Sine(amplitude, start, draw(st.sampled_from([duration, inf])), frequency)
    if kind is Trapezoid:
        return Trapezoid(amplitude, start, 2.0 / frequency + duration, frequency)
    if kind is Table:
        times = [time / 8.0 for time in draw(INCREASING)]
        count = len(times)
        values = draw(st.lists(st.floats(-2.0, 2.0), min_size=count, max_size=count))
        return Table(tuple(times), tuple(values))
    return kind(amplitude, start, duration)


def defined(course: Any) -> Callable[[float], float]:
    """Return the course as a function of time, written from its definition."""
    if isinstance(course, Table):
        return lambda t: float(np.interp(t, course.times, course.values))
    amplitude, start, end = course.amplitude, course.start, course.start + course.duration
    match course:
        case Step():
            return lambda t: amplitude if start <= t < end else 0.0
        case Ramp():
            return lambda t: amplitude * min(max((t - start) / course.duration, 0.0), 1.0)
        case Sine(frequency=frequency):
            return lambda t: (
                amplitude * sin(2.0 * pi * frequency * (t - start)) if start <= t < end else 0.0
            )
        case Trapezoid(frequency=frequency):
            return lambda t: (
                amplitude * max(0.0, min((t - start) * frequency, 1.0, (end - t) * frequency))
            )
    raise AssertionError(course)


def corners(course: Any) -> list[float]:
    if isinstance(course, Table):
        return list(course.times)
    ends = [course.start, course.start + course.duration]
    if isinstance(course, Trapezoid):
        rise = 1.0 / course.frequency
        ends += [ends[0] + rise, ends[1] - rise]
    return [end for end in ends if end < inf]


@given(courses(), st.floats(0.0, 12.0))
@examples(quick=100, thorough=2000)
def test_values_are_those_of_the_definition(course: PiecewiseCourse, time: float) -> None:
    assume(all(abs(time - corner) > 1e-9 for corner in corners(course)))
    assert course.at(time) == pytest.approx(defined(course)(time), abs=1e-9)


@given(courses())
def test_at_a_corner_the_value_is_that_after_it(course: PiecewiseCourse) -> None:
    for corner in corners(course):
        if corner >= 0.0:
            after = defined(course)(corner + 1e-12)
            assert course.at(corner) == pytest.approx(after, abs=1e-9)


@given(courses(), st.floats(0.0, 8.0), st.floats(0.0, 4.0))
@examples(quick=50, thorough=500)
def test_the_integral_is_exact(course: PiecewiseCourse, start: float, length: float) -> None:
    end = start + length
    places = sorted({start, end, *(c for c in corners(course) if start < c < end)})
    expected = sum(
        quad(defined(course), a + 1e-13, b - 1e-13, epsabs=1e-12, limit=200)[0]
        for a, b in pairwise(places)
    )
    assert course.integral(start, end) == pytest.approx(expected, abs=1e-10)


@given(courses(), st.floats(0.0, 8.0))
@examples(quick=50, thorough=500)
def test_rates_are_derivatives(course: PiecewiseCourse, time: float) -> None:
    step = 1e-4
    assume(all(abs(time - corner) > 2.0 * step for corner in corners(course)))
    before, after = course.at(time - step), course.at(time + step)
    error = 2.0 * (2.0 * pi * 3.0) ** 3 * step**2 + 1e-8
    assert course.rates(time)[0] == pytest.approx((after - before) / (2.0 * step), abs=error)
    slopes = course.rates(time - step)[0], course.rates(time + step)[0]
    error = 2.0 * (2.0 * pi * 3.0) ** 4 * step**2 + 1e-8
    assert course.rates(time)[1] == pytest.approx((slopes[1] - slopes[0]) / (2.0 * step), abs=error)


@given(courses())
@examples(quick=15, thorough=500)
def test_bounds_are_the_extremes(course: PiecewiseCourse) -> None:
    ends = corners(course)
    times = [*np.linspace(0.0, 30.0, 30_001).tolist(), *ends, *(end - 1e-12 for end in ends)]
    found = [course.at(time) for time in times if time >= 0.0]
    low, high = course.bounds
    spacing = 2.0 * (2.0 * pi * 3.0) ** 2 * 1e-3**2
    assert low - 1e-9 <= min(found) <= low + spacing
    assert high - spacing <= max(found) <= high + 1e-9


@given(courses())
def test_steepest_is_the_largest_rate(course: PiecewiseCourse) -> None:
    for time in np.linspace(0.0, 12.0, 200).tolist():
        assert abs(course.rates(time)[0]) <= course.steepest * (1.0 + 1e-12)


@given(courses(), st.floats(0.0, 12.0))
def test_units(course: PiecewiseCourse, time: float) -> None:
    """In other units of time and of what it gives it is the same course."""
    assume(all(abs(time - corner) > 1e-9 for corner in corners(course)))
    other = scaled(course, Scales(length=3.0, speed=6.0, force=5.0), "N")
    assert other.at(2.0 * time) == pytest.approx(course.at(time) / 5.0, abs=1e-9)


def test_shapes() -> None:
    sine = Sine(2.0, start=1.0, frequency=0.25)
    assert [sine.at(t) for t in (0.5, 1.0, 2.0, 4.0)] == pytest.approx([0.0, 0.0, 2.0, -2.0])
    assert sine.bounds == pytest.approx((-2.0, 2.0))
    assert replace(sine, duration=1.0).bounds == pytest.approx((0.0, 2.0))
    assert replace(sine, duration=0.5).bounds == pytest.approx((0.0, 2.0 * cos(pi / 4.0)))
    assert [Impulse(2.0, 1.0).sampled(0.01).at(t) for t in (0.99, 1.005, 1.01)] == [0.0, 2.0, 0.0]
    assert Step(2.0, 1.0, 0.0).bounds == (0.0, 0.0)
    assert Trapezoid(1.0, 0.0, 2.0, 1.0).integral(0.0, 5.0) == pytest.approx(1.0)


def test_no_course() -> None:
    assert NO_COURSE.at(3.0) == NO_COURSE.integral(0.0, 3.0) == NO_COURSE.steepest == 0.0
    assert NO_COURSE.bounds == (0.0, 0.0)
    assert NO_COURSE.refusal() is None


@pytest.mark.parametrize(
    ("course", "refusal"),
    [
        (Ramp(1.0, duration=inf), "duration = inf s: must be above 0 and finite for a ramp"),
        (Ramp(1.0, duration=0.0), "duration = 0.0 s: must be above 0 and finite for a ramp"),
        (Ramp(1.0, duration=nan), "duration = nan s: must be above 0 and finite for a ramp"),
        (
            Trapezoid(1.0, duration=inf),
            "duration = inf s: must be above 0 and finite for a trapezoid",
        ),
        (
            Trapezoid(1.0, duration=0.9, frequency=2.0),
            "duration = 0.9 s: must be at least 2/frequency = 1 s for a trapezoid",
        ),
        (
            Table((0.0, 0.0), (1.0, 2.0)),
            "point 2 of the table: the time must be above the one before",
        ),
        (
            Table((0.0,), (1.0, 2.0)),
            "times and values have 1 and 2 numbers: must have as many, at least one",
        ),
        (Table((0.0, nan), (1.0, 2.0)), "times and values must be finite"),
        (
            Table((0.0, 1e-300), (0.0, 1e30)),
            "times and values rise too steeply: the slopes must be finite",
        ),
    ],
)
def test_refusals(course: PiecewiseCourse, refusal: str) -> None:
    assert course.refusal() == refusal
