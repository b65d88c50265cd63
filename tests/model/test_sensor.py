"""The sensor: rounding, differences, and the statistics of its noise."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.model.sensor import EXACT_SENSOR, MeasuredVelocity, Sensor
from tests.examples import examples

PERIOD = 1e-3
DIFFERENCE = Sensor(velocity=MeasuredVelocity.DIFFERENCE)


def measured(sensor: Sensor, positions: np.ndarray, first: int = 0) -> np.ndarray:
    """Positions and velocities (rows) that a sensor tells; the true velocity is 0."""
    measure = sensor.start(PERIOD, first)
    rows = [measure(x, 0.0) for x in positions.tolist()]
    return np.array(rows).T


def test_an_exact_sensor_measures_nothing() -> None:
    assert EXACT_SENSOR.start(PERIOD) is None
    assert replace(EXACT_SENSOR, seed=3, difference_samples=5).start(PERIOD) is None


@given(st.floats(-1e3, 1e3), st.floats(1e-9, 1.0))
@examples(quick=50, thorough=100)
def test_a_position_is_rounded_to_the_nearest_step(position: float, resolution: float) -> None:
    told, _ = measured(Sensor(resolution), np.array([position]))
    assert abs(told[0] - position) <= resolution * (0.5 + 1e-6)
    assert told[0] / resolution == pytest.approx(round(told[0] / resolution), abs=1e-3)


def test_a_half_is_rounded_to_even() -> None:
    told, _ = measured(Sensor(2.0), np.array([-5.0, -3.0, -1.0, 1.0, 3.0, 5.0]))
    assert told.tolist() == [-4.0, -4.0, 0.0, 0.0, 4.0, 4.0]


def test_far_away_floats_are_coarser_than_the_steps() -> None:
    told, _ = measured(Sensor(1e-300), np.array([1e300, -1.0]))
    assert told.tolist() == [1e300, -1.0]


@pytest.mark.parametrize("spans", [1, 2, 8])
def test_a_difference_spans_samples_and_fewer_at_the_start(spans: int) -> None:
    positions = np.random.default_rng(1).normal(size=20)
    sensor = replace(DIFFERENCE, position_resolution=0.1, difference_samples=spans)
    told, velocity = measured(sensor, positions)
    rounded = 0.1 * np.rint(positions / 0.1)
    assert told == pytest.approx(rounded, abs=1e-14)
    assert velocity[0] == 0.0
    for number in range(1, 20):
        back = min(number, spans)
        change = rounded[number] - rounded[number - back]
        assert velocity[number] == pytest.approx(change / (back * PERIOD), rel=1e-12, abs=1e-9)


def test_the_noise_of_many_samples_is_normal_and_white() -> None:
    """Each statistic within five of its own standard deviations."""
    count = 100_000
    found = measured(Sensor(position_noise=2.0, velocity_noise=3.0, seed=7), np.zeros(count))
    for values, deviation in zip(found, (2.0, 3.0), strict=True):
        noise = values / deviation
        assert abs(noise.mean()) < 5.0 / sqrt(count)
        assert abs(noise.std() - 1.0) < 5.0 / sqrt(2.0 * count)
        assert abs((noise**3).mean()) < 5.0 * sqrt(15.0 / count)
        assert abs((noise**4).mean() - 3.0) < 5.0 * sqrt(96.0 / count)
        for lag in (1, 2, 3, 10, 1023, 1024, 1025):
            assert abs((noise[lag:] * noise[:-lag]).mean()) < 5.0 / sqrt(count)
        # The largest of half a million ordinates of white noise is near ln(n/2).
        power = np.abs(np.fft.rfft(noise)[1:]) ** 2 / count
        assert power.max() < np.log(count / 2.0) + 13.0
        low, high = np.array_split(power, 2)
        assert low.mean() == pytest.approx(high.mean(), rel=20.0 / sqrt(count))
    position, velocity = found[0] / 2.0, found[1] / 3.0
    assert abs((position * velocity).mean()) < 5.0 / sqrt(count)


@given(st.integers(0, 5000), st.integers(0, 2**62))
@examples(quick=20, thorough=60)
def test_noise_depends_on_seed_and_number_only(first: int, seed: int) -> None:
    sensor = Sensor(position_noise=1.0, seed=seed)
    whole, _ = measured(sensor, np.zeros(first + 30))
    part, _ = measured(sensor, np.zeros(30), first)
    assert part.tolist() == whole[first:].tolist()
    other, _ = measured(replace(sensor, seed=seed + 1), np.zeros(30), first)
    assert not np.any(other == part)


def test_noise_stays_the_same_in_all_versions() -> None:
    told, _ = measured(Sensor(position_noise=1.0), np.zeros(3))
    noise = [-0.5199535734446672, -2.743804532142861, 0.985968313441401]
    assert told == pytest.approx(noise, rel=1e-12)
