from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stickslip_ros.physics.model.courses import PiecewiseCourse, Ramp, Table, Trapezoid
from stickslip_ros.physics.model.disturbance import Disturbance, DisturbanceKind

PERIOD = 0.01


def forces(disturbance: Disturbance, count: int, period: float = PERIOD) -> list[float]:
    return [disturbance.force(number, period) for number in range(count)]


def test_by_default_there_is_none() -> None:
    assert forces(Disturbance(), 5) == [0.0] * 5
    nothing = Disturbance(DisturbanceKind.STEP, amplitude=3.0, start=0.02, duration=0.0)
    assert forces(nothing, 7) == [0.0] * 7


def test_a_step_lasts() -> None:
    step = Disturbance(DisturbanceKind.STEP, amplitude=-3.0, start=0.02)
    assert forces(step, 5) == [0.0, 0.0, -3.0, -3.0, -3.0]
    assert step.force(10**8, PERIOD) == -3.0


@given(st.integers(0, 5000), st.integers(1, 100), st.integers(1, 5000))
def test_a_step_on_the_grid_lasts_for_its_samples(first: int, count: int, rate: int) -> None:
    period = 1.0 / rate
    step = Disturbance(
        DisturbanceKind.STEP, amplitude=1.0, start=first / rate, duration=count / rate
    )
    acting = [n for n in range(first + count + 3) if step.force(n, period) != 0.0]
    assert acting == list(range(first, first + count))


@given(st.integers(0, 10**6), st.integers(1, 5000))
@example(start=55_000, rate=100)
@example(start=65_000, rate=100)
def test_an_impulse_is_the_sample_nearest_to_its_start(start: int, rate: int) -> None:
    """The start in microseconds; midway between two samples either is the nearest."""
    period = 1.0 / rate
    impulse = Disturbance(DisturbanceKind.IMPULSE, amplitude=1.0, start=start * 1e-6)
    around = Fraction(start * rate, 10**6)
    candidates = range(max(0, int(around) - 2), int(around) + 4)
    (acting,) = [n for n in candidates if impulse.force(n, period) == 1.0]
    assert abs(acting - around) <= Fraction(1, 2)


def test_a_sine_starts_from_zero() -> None:
    sine = Disturbance(DisturbanceKind.SINE, amplitude=2.0, start=0.02, frequency=12.5)
    # A period of 0.08 s: an eighth of a turn from sample to sample.
    half = 2.0 * 0.5**0.5
    assert forces(sine, 11) == pytest.approx(
        [0.0, 0.0, 0.0, half, 2.0, half, 0.0, -half, -2.0, -half, 0.0], abs=1e-14
    )


@pytest.mark.parametrize(
    ("disturbance", "course"),
    [
        (Disturbance(DisturbanceKind.RAMP, 2.0, 0.013, 0.05), Ramp(2.0, 0.013, 0.05)),
        (
            Disturbance(DisturbanceKind.TRAPEZOID, 2.0, 0.01, 0.1, 25.0),
            Trapezoid(2.0, 0.01, 0.1, 25.0),
        ),
        (
            Disturbance(DisturbanceKind.TABLE, table=Table((0.0, 0.1), (1.0, -1.0))),
            Table((0.0, 0.1), (1.0, -1.0)),
        ),
    ],
)
def test_other_kinds_are_samples_of_their_course(
    disturbance: Disturbance, course: PiecewiseCourse
) -> None:
    assert disturbance.refusal() is None
    assert forces(disturbance, 20) == [course.at(number * PERIOD) for number in range(20)]
