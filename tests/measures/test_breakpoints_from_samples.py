from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.breakpoints import Breakpoints, breakpoints_from_samples
from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.measures.cycle_meter import CycleMeter

CYCLES = 15

Columns = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Time, position, velocity and belt velocity of samples."""


def measured(breakpoints: Breakpoints, belt_speed: float) -> Measures:
    meter = CycleMeter(window=CYCLES)
    meter.feed(breakpoints, belt_speed)
    return meter.measures()


def test_coarse_samples_of_a_sine_give_its_turning_points() -> None:
    time = np.linspace(0.05, 4.0 * pi, 50)  # 25 a cycle
    breakpoints = breakpoints_from_samples(time, np.sin(time), np.cos(time), np.full(50, 2.0))
    turning = breakpoints[breakpoints.velocity == 0.0]
    assert turning.time == pytest.approx([pi / 2, 3 * pi / 2, 5 * pi / 2, 7 * pi / 2], abs=1e-3)
    assert turning.position == pytest.approx([1.0, -1.0, 1.0, -1.0], abs=1e-4)
    assert breakpoints.velocity.max() == pytest.approx(1.0, abs=1e-4)
    assert set(time) <= set(breakpoints.time)
    assert np.all(np.diff(breakpoints.time) >= 0.0)
    assert not breakpoints.sticking.any()


def test_samples_on_the_belt_stick() -> None:
    """The slide rides the belt from the second to the fourth of five samples."""
    velocity = np.array([0.1, 0.5, 0.5, 0.5, 0.3])
    position = np.array([0.0, 0.35, 0.85, 1.35, 1.75])
    breakpoints = breakpoints_from_samples(np.arange(5.0), position, velocity, np.full(5, 0.5))
    stuck = breakpoints[breakpoints.sticking]
    assert set(stuck.time) >= {1.0, 2.0, 3.0}
    assert np.all(stuck.velocity == 0.5)
    # In the first interval it falls 0.15 short of the belt: 0.4 s / 2 at relative speed, 0.75 s
    # of slip; in the last one 0.1: 0.2 s' / 3, more than there is time, so it left at once.
    landed, left = stuck.time[0] - 0.25, stuck.time[-1]
    assert landed == pytest.approx(0.75)
    assert left == pytest.approx(3.0)


BELT_SPEED = 0.5
PERIOD = 1.0
SLIP_TIME = 0.6
SLIP_SPEED = BELT_SPEED * PERIOD * pi / (2.0 * SLIP_TIME)
"""Largest relative speed: with it the slide is back where it was after a period."""
STICK_SPEED = 0.01 * BELT_SPEED


def stick_and_sine(per_period: int, seed: int, periods: int = 10) -> tuple[Columns, float]:
    """Samples of slip by half a sine and stick with noise; their fraction within STICK_SPEED.

    The velocity relative to the belt is -SLIP_SPEED sin(pi t/SLIP_TIME) during slip; during stick
    its samples are random within 0.3 STICK_SPEED.
    """
    generator = np.random.default_rng(seed)
    count = periods * per_period
    time = (np.arange(count) + generator.random()) * PERIOD / per_period
    phase = time % PERIOD
    slips = phase < SLIP_TIME
    angle = pi * np.minimum(phase, SLIP_TIME) / SLIP_TIME
    noise = generator.uniform(-0.3, 0.3, count) * STICK_SPEED
    relative_velocity = np.where(slips, -SLIP_SPEED * np.sin(angle), noise)
    velocity = BELT_SPEED + relative_velocity
    position = BELT_SPEED * phase - SLIP_SPEED * SLIP_TIME / pi * (1.0 - np.cos(angle))
    within = 2.0 * np.arcsin(STICK_SPEED / SLIP_SPEED) / pi * SLIP_TIME
    stick_fraction = (PERIOD - SLIP_TIME + within) / PERIOD
    return (time, position, velocity, np.full(count, BELT_SPEED)), stick_fraction


def stick_time(samples: Columns, stick_speed: float) -> float:
    breakpoints = breakpoints_from_samples(*samples, stick_speed=stick_speed)
    return float(np.diff(breakpoints.time)[breakpoints.sticking[1:]].sum())


@pytest.mark.parametrize(("per_period", "seed"), [(30, 0), (100, 1), (3000, 2)])
def test_the_stick_fraction_of_noisy_samples_converges(per_period: int, seed: int) -> None:
    samples, expected = stick_and_sine(per_period, seed)
    breakpoints = breakpoints_from_samples(*samples, stick_speed=STICK_SPEED)
    measures = measured(breakpoints, BELT_SPEED)
    assert measures.cycles == 9
    assert measures.regime is Regime.STICK_SLIP
    assert measures.stick_fraction == pytest.approx(expected, abs=0.2 / per_period)
    assert measures.period == pytest.approx(PERIOD, rel=1e-6)
    exact = measured(breakpoints_from_samples(*samples), BELT_SPEED)
    assert exact.stick_fraction == 0.0


@pytest.mark.parametrize(("per_period", "error"), [(25, 4e-3), (100, 2.5e-4)])
def test_a_smooth_motion_sticks_while_it_is_near_the_velocity_of_the_belt(
    per_period: int, error: float
) -> None:
    """A sine with a peak just at the velocity of the belt."""
    time = 2.0 * pi * np.arange(10 * per_period) / per_period + 0.01
    samples = time, np.sin(time), np.cos(time), np.ones(len(time))
    measures = measured(breakpoints_from_samples(*samples, stick_speed=0.2), 1.0)
    assert measures.stick_fraction == pytest.approx(np.arccos(0.8) / pi, abs=error)
    assert measures.amplitude == pytest.approx(1.0, rel=1e-3)
    assert measures.period == pytest.approx(2.0 * pi, rel=1e-4)


def test_a_slide_on_a_belt_at_rest_turns_where_it_sticks() -> None:
    time = np.linspace(0.05, 4.0 * pi, 50)
    samples = time, np.sin(time), np.cos(time), np.zeros(50)
    breakpoints = breakpoints_from_samples(*samples, stick_speed=0.4)
    turning = breakpoints[breakpoints.velocity == 0.0]
    assert turning.sticking.all()
    assert turning.position == pytest.approx([1.0, -1.0, 1.0, -1.0], abs=1e-4)


def test_the_edges_of_a_threshold_are_where_the_relative_speed_reaches_it() -> None:
    """The displacements agree with those of the speeds, in either direction."""
    for sign in (1.0, -1.0):
        # Slip at 1 m/s that falls to 0 at 0.5 s; the slide leaves at 0.6 s with 10 t^2.
        velocity = sign * np.array([1.0, 0.0, 1.6])
        position = sign * np.array([0.0, 0.25, 0.25 + 10.0 * 0.4**3 / 3.0])
        samples = np.arange(3.0), position, 2.0 + velocity, np.full(3, 2.0)
        samples[1][:] += 2.0 * samples[0]
        inside = breakpoints_from_samples(*samples, stick_speed=0.1, exact_times=False)
        assert inside.time == pytest.approx([0.0, 0.45, 1.0, 1.7, 2.0])
        assert inside.velocity - 2.0 == pytest.approx(sign * np.array([1.0, 0.1, 0.0, 0.1, 1.6]))
        assert inside.sticking.tolist() == [False, False, True, True, False]
        relative = inside.position - 2.0 * inside.time
        assert relative[1] == pytest.approx(sign * (0.25 - 0.1 * 0.05 / 2.0))
        assert relative[3] == pytest.approx(sign * (0.25 + 0.1 * 0.1 / 3.0))


def random_samples(seed: int, count: int, noise: float) -> Columns:
    """Samples of stick and sine, or of no law at all, at irregular times."""
    generator = np.random.default_rng(seed)
    (time, position, velocity, belt_velocity), _ = stick_and_sine(count, seed, periods=2)
    time = time + generator.uniform(0.0, 0.9, len(time)) * PERIOD / count
    position = position + noise * generator.normal(size=len(time)) / count
    velocity = velocity + noise * generator.normal(size=len(time))
    belt_velocity = belt_velocity + noise * generator.normal(size=len(time))
    return time, position, velocity, belt_velocity


@given(
    st.integers(0, 1000),
    st.integers(5, 100),
    st.sampled_from([0.0, 1e-3, 1e-2, 1.0]),
    st.lists(st.floats(0.0, 2.0), min_size=2, max_size=8).map(sorted),
)
def test_the_stick_time_does_not_decrease_with_the_stick_speed(
    seed: int, count: int, noise: float, stick_speeds: list[float]
) -> None:
    samples = random_samples(seed, count, noise)
    times = [stick_time(samples, stick_speed) for stick_speed in stick_speeds]
    assert np.all(np.diff(times) >= -1e-12)
    assert times[-1] <= samples[0][-1] - samples[0][0] + 1e-12


@given(
    st.integers(0, 1000),
    st.integers(5, 100),
    st.sampled_from([0.0, 1e-2, 1.0]),
    st.floats(0.0, 1.0),
    st.integers(-20, 20),
)
def test_the_unit_of_length_changes_nothing(
    seed: int, count: int, noise: float, stick_speed: float, exponent: int
) -> None:
    time, *lengths = random_samples(seed, count, noise)
    unit = 2.0**exponent  # exact in floating point
    scaled = [unit * length for length in lengths]
    expected = breakpoints_from_samples(time, *lengths, stick_speed=stick_speed)
    breakpoints = breakpoints_from_samples(time, *scaled, stick_speed=unit * stick_speed)
    assert np.array_equal(breakpoints.time, expected.time)
    assert np.array_equal(breakpoints.position, unit * expected.position)
    assert np.array_equal(breakpoints.velocity, unit * expected.velocity)
    assert np.array_equal(breakpoints.sticking, expected.sticking)
