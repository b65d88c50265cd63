"""Signals: values, corners, derivatives, integrals, bounds and refusals, from their definitions."""

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from math import ceil, inf, nan, pi, sin
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from scipy.integrate import quad

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Scales
from stickslip_ros.model.control import NO_REFERENCE, Reference
from stickslip_ros.model.signals import (
    NO_SIGNAL,
    Signal,
    impulse,
    ramp,
    sine,
    step,
    table,
    trapezoid,
)
from tests.examples import examples

INCREASING = st.lists(st.integers(-20, 60), min_size=1, max_size=6, unique=True).map(sorted)
PERIOD = 0.01


class Case(NamedTuple):
    """A signal, the same from its definition, and the times at which pieces end."""

    signal: Signal
    defined: Callable[[float], float]
    corners: list[float]


@st.composite
def cases(draw: st.DrawFn) -> Case:
    amplitude, start = draw(st.floats(-2.0, 2.0)), draw(st.just(0.0) | st.floats(0.0, 3.0))
    duration, frequency = draw(st.floats(0.1, 5.0)), draw(st.floats(0.1, 3.0))
    end = start + duration
    match draw(st.sampled_from(["step", "ramp", "sine", "trapezoid", "table"])):
        case "step":
            signal = step(amplitude, start, duration)
            return Case(signal, lambda t: amplitude * (start <= t < end), [start, end])
        case "ramp":

            def rising(t: float) -> float:
                return amplitude * min(max((t - start) / duration, 0.0), 1.0)

            return Case(ramp(amplitude, start, duration), rising, [start, end])
        case "sine":
            lasts = draw(st.sampled_from([duration, inf]))

            def swinging(t: float) -> float:
                turn = 2.0 * pi * frequency * (t - start)
                return amplitude * sin(turn) if start <= t < start + lasts else 0.0

            corners = [start] if lasts == inf else [start, end]
            return Case(sine(amplitude, start, lasts, frequency), swinging, corners)
        case "trapezoid":
            rise, end = 1.0 / frequency, end + 2.0 / frequency

            def holding(t: float) -> float:
                return amplitude * max(0.0, min((t - start) / rise, 1.0, (end - t) / rise))

            signal = trapezoid(amplitude, start, end - start, frequency)
            return Case(signal, holding, [start, start + rise, end - rise, end])
        case _:
            times = [time / 8.0 for time in draw(INCREASING)]
            count = len(times)
            values = draw(st.lists(st.floats(-2.0, 2.0), min_size=count, max_size=count))
            points = list(zip(times, values, strict=True))
            return Case(table(points), lambda t: float(np.interp(t, times, values)), times)


@given(cases(), st.floats(0.0, 12.0))
@examples(quick=100, thorough=200)
def test_values_are_those_of_the_definition(case: Case, time: float) -> None:
    assume(all(abs(time - corner) > 1e-9 for corner in case.corners))
    assert case.signal.at(time) == pytest.approx(case.defined(time), abs=1e-9)
    for corner in (corner for corner in case.corners if corner >= 0.0):
        after = case.defined(corner + 1e-12)
        assert case.signal.at(corner) == pytest.approx(after, abs=1e-9)


@given(cases(), st.floats(0.0, 8.0), st.floats(0.0, 4.0))
@examples(quick=20, thorough=100)
def test_the_integral_is_exact(case: Case, start: float, length: float) -> None:
    end = start + length
    places = sorted({start, end, *(c for c in case.corners if start < c < end)})
    expected = sum(
        quad(case.defined, a + 1e-13, b - 1e-13, epsabs=1e-12, limit=200)[0]
        for a, b in pairwise(places)
    )
    assert case.signal.integral(start, end) == pytest.approx(expected, abs=1e-10)


@given(cases(), st.floats(0.0, 8.0))
@examples(quick=50, thorough=200)
def test_velocity_and_acceleration_are_derivatives(case: Case, time: float) -> None:
    step, signal = 1e-4, case.signal
    assume(all(abs(time - corner) > 2.0 * step for corner in case.corners))
    before, now, after = (signal.reference(t) for t in (time - step, time, time + step))
    assert now.position == signal.at(time)
    for order, (value, name) in enumerate(pairwise(Reference._fields), start=3):
        error = 2.0 * (2.0 * pi * 3.0) ** order * step**2 + 1e-8
        slope = (getattr(after, value) - getattr(before, value)) / (2.0 * step)
        assert getattr(now, name) == pytest.approx(slope, abs=error)


@given(cases())
@examples(quick=15, thorough=40)
def test_bounds_and_steepest_are_the_extremes(case: Case) -> None:
    ends, signal = case.corners, case.signal
    times = [*np.linspace(0.0, 12.0, 3001).tolist(), *ends, *(end - 1e-12 for end in ends)]
    found = [signal.at(time) for time in times if time >= 0.0]
    low, high = signal.bounds
    spacing = 2.0 * (2.0 * pi * 3.0) ** 2 * 4e-3**2
    assert low - 1e-9 <= min(found) <= low + spacing
    assert high - spacing <= max(found) <= high + 1e-9
    for time in np.linspace(0.0, 12.0, 200).tolist():
        velocity = signal.reference(time).velocity or 0.0
        assert abs(velocity) <= signal.steepest * (1.0 + 1e-12)


@given(cases(), st.floats(0.0, 12.0))
def test_units(case: Case, time: float) -> None:
    """In other units of time and of what it gives it is the same signal."""
    assume(all(abs(time - corner) > 1e-9 for corner in case.corners))
    other = case.signal.scaled(Scales(length=3.0, speed=6.0, force=5.0), "N")
    assert other.at(2.0 * time) == pytest.approx(case.signal.at(time) / 5.0, abs=1e-9)


def test_without_pieces_it_is_zero() -> None:
    assert NO_SIGNAL.at(3.0) == NO_SIGNAL.integral(0.0, 3.0) == NO_SIGNAL.steepest == 0.0
    assert NO_SIGNAL.bounds == (0.0, 0.0)
    assert NO_SIGNAL.reference(3.0) is NO_REFERENCE
    assert NO_SIGNAL.held(PERIOD) == NO_SIGNAL


def test_a_corner_has_the_derivatives_after_it() -> None:
    feed = trapezoid(0.5, 1.0, 8.0, frequency=0.5)
    assert [feed.reference(time) for time in (0.0, 1.0, 2.0, 3.0, 7.0, 8.0, 9.0)] == [
        Reference(0.0, 0.0, 0.0),
        Reference(0.0, 0.25, 0.0),
        Reference(0.25, 0.25, 0.0),
        Reference(0.5, 0.0, 0.0),
        Reference(0.5, -0.25, 0.0),
        Reference(0.25, -0.25, 0.0),
        Reference(0.0, 0.0, 0.0),
    ]
    wave = sine(0.5, frequency=0.25)
    assert wave.reference(1.0) == pytest.approx(Reference(0.5, 0.0, -0.125 * pi**2))


def forces(signal: Signal, count: int, period: float = PERIOD) -> list[float]:
    held = signal.held(period)
    return [held.at(number * period) for number in range(count)]


def test_held_without_jumps_it_is_sampled() -> None:
    for signal in (
        ramp(2.0, 0.013, 0.05),
        trapezoid(2.0, 0.013, 0.1, 25.0),
        table([(0.0, 1.0), (0.014, 1.0), (0.028, 1.0), (0.1, -1.0)]),
    ):
        assert forces(signal, 20) == [signal.at(number * PERIOD) for number in range(20)]


def test_a_held_step_lasts() -> None:
    assert forces(step(3.0, 0.02, 0.0), 7) == [0.0] * 7
    assert forces(step(-3.0, 0.02), 5) == [0.0, 0.0, -3.0, -3.0, -3.0]
    assert forces(step(3.0, 0.016, 0.006), 4) == [0.0, 0.0, 3.0, 0.0]


@given(st.integers(0, 5000), st.integers(1, 100), st.integers(1, 5000))
def test_a_held_step_on_the_grid_lasts_for_its_samples(first: int, count: int, rate: int) -> None:
    found = forces(step(1.0, first / rate, count / rate), first + count + 3, 1.0 / rate)
    assert [n for n, force in enumerate(found) if force] == list(range(first, first + count))


@given(st.integers(0, 10**6), st.integers(1, 5000))
@example(start=55_000, rate=100)
@example(start=65_000, rate=100)
def test_a_held_impulse_is_the_first_sample_from_its_start_on(start: int, rate: int) -> None:
    """The start in microseconds."""
    period = 1.0 / rate
    held = impulse(1.0, period, start * 1e-6).held(period)
    first = ceil(Fraction(start * rate, 10**6))
    assert [n for n in range(max(0, first - 2), first + 4) if held.at(n * period)] == [first]


@given(st.integers(1, 2_000), st.integers(1, 9_000))
def test_a_reference_starts_at_the_sample_that_is_its_start(number: int, rate: int) -> None:
    """The time of a sample is that of its stamp, a whole number of nanoseconds."""
    signal = step(1.0, number / rate)
    times = [round(sample * 1e9 / rate) * 1e-9 for sample in (number - 1, number)]
    assert [signal.reference(time).position for time in times] == [0.0, 1.0]


@given(st.floats(0.0, 5.0), st.floats(1e-3, 1.0))
def test_a_held_sine_is_zero_before_its_start(start: float, period: float) -> None:
    held = sine(1.0, start, frequency=0.01 / period).held(period)
    samples = range(max(0, int(start / period) - 3), int(start / period) + 1)
    assert all(held.at(n * period) == 0.0 for n in samples if n * period < start * (1.0 - 1e-12))


def test_a_held_sine_starts_from_zero() -> None:
    # A period of 0.08 s: an eighth of a turn from sample to sample.
    half = 2.0 * 0.5**0.5
    assert forces(sine(2.0, 0.02, frequency=12.5), 11) == pytest.approx(
        [0.0, 0.0, 0.0, half, 2.0, half, 0.0, -half, -2.0, -half, 0.0], abs=1e-14
    )


@pytest.mark.parametrize(
    ("make", "arguments", "refusal"),
    [
        (ramp, (1.0, 0.0, inf), "duration = inf s: must be above 0 and finite for a ramp"),
        (ramp, (1.0, 0.0, 0.0), "duration = 0.0 s: must be above 0 and finite for a ramp"),
        (ramp, (1.0, 0.0, nan), "duration = nan s: must be above 0 and finite for a ramp"),
        (
            trapezoid,
            (1.0, 0.0, inf),
            "duration = inf s: must be above 0 and finite for a trapezoid",
        ),
        (
            trapezoid,
            (1.0, 0.0, 0.9, 2.0),
            "duration = 0.9 s: must be at least 2/frequency = 1 s for a trapezoid",
        ),
        (table, ([],), "the table has no points: must have at least one"),
        (
            table,
            ([(0.0, 1.0), (0.0, 2.0)],),
            "point 2 of the table: the time must be above the one before",
        ),
        (table, ([(0.0, 1.0), (nan, 2.0)],), "times and values must be finite"),
        (
            table,
            ([(0.0, 0.0), (1e-300, 1e30)],),
            "times and values rise too steeply: the slopes must be finite",
        ),
    ],
)
def test_what_makes_no_signal_is_refused(
    make: Any, arguments: tuple[Any, ...], refusal: str
) -> None:
    with pytest.raises(InvalidInputError) as refused:
        make(*arguments)
    assert str(refused.value) == refusal
