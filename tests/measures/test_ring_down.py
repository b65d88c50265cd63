"""Ring-downs: their decay rate and frequency against those of the signal, under rounding."""

from math import pi

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.ring_down import RingDown, ring_downs, why_no_ring_down

PERIOD = 1e-3
TIME = PERIOD * np.arange(5000, dtype=np.float64)
BELT = 0.05
FEED = np.full(len(TIME), BELT)
TAPS = (0.5, 1.7, 3.1)


def tapped(decay: float, frequency: float, amplitude: float, effect: float = 0.0) -> FloatArray:
    """Return a motion that starts anew at each tap; r' = -(decay + effect r^2/a^2) r."""
    position = np.zeros(len(TIME))
    for tap in TAPS:
        own = tap <= TIME
        since = TIME[own] - tap
        spent = (1.0 - np.exp(-2.0 * decay * since)) / (2.0 * decay)
        size = amplitude * np.exp(-decay * since) / np.sqrt(1.0 + 2.0 * effect * spent)
        position[own] = size * np.sin(2.0 * pi * frequency * since)
    return position + 3e-4


def found(position: FloatArray, belt: FloatArray = FEED) -> list[RingDown]:
    return [*ring_downs(position, belt, PERIOD)]


@example(0.37109375, 35.5, 4.350174748881634e-05, 0)
@given(st.floats(0.3, 4.0), st.floats(12.0, 40.0), st.floats(1e-5, 5e-5), st.integers(0, 99))
def test_decay_and_frequency_are_those_of_the_signal(
    decay: float, frequency: float, amplitude: float, seed: int
) -> None:
    step = amplitude / 20.0
    offset = np.random.default_rng(seed).uniform(0.0, step)
    position = step * np.round((tapped(decay, frequency, amplitude) + offset) / step)
    own = found(position)
    assert len(own) == len(TAPS)
    for tap, each in zip(TAPS, own, strict=True):
        assert tap - 1e-2 < each.start < tap + 2.0 / frequency + 1e-2
        assert each.decay_rate == pytest.approx(decay, abs=5.0 * each.decay_error)
        assert each.frequency == pytest.approx(frequency, abs=5.0 * each.frequency_error)
        assert each.decay_error < 0.1 * decay + 0.2
        assert each.belt_speed == pytest.approx(BELT)


def test_a_tap_beside_a_lasting_vibration_is_no_ring_down() -> None:
    """No decay fits it: a search that does not converge ends."""
    tap = np.exp(-6.0 * TIME) * np.sin(2.0 * pi * 58.0 * TIME)
    position = 1e-6 * (tap + np.sin(2.0 * pi * 55.1 * TIME + 1.0))
    assert found(position[:3000], 0.4 * FEED[:3000]) == []


def test_the_decay_is_that_of_small_amplitudes() -> None:
    plain, bent = (found(tapped(2.0, 16.0, 5e-5, effect)) for effect in (0.0, 0.3))
    for each, other in zip(plain, bent, strict=True):
        assert each.decay_rate == pytest.approx(2.0, rel=1e-4)
        assert other.decay_rate == pytest.approx(2.0, rel=2e-3)


def test_noise_is_in_the_errors() -> None:
    noise = 2e-6 * np.random.default_rng(3).standard_normal(len(TIME))
    own = found(tapped(1.5, 16.0, 4e-5) + noise)
    deviations = [(each.decay_rate - 1.5) / each.decay_error for each in own]
    assert len(own) == 3
    assert np.abs(deviations).max() < 3.0


def test_a_step_of_the_feed_starts_a_ring_down_of_its_own() -> None:
    belt = np.where(TIME < 1.7, BELT, 1.03 * BELT)
    assert [each.belt_speed for each in found(tapped(1.0, 16.0, 5e-5), belt)] == pytest.approx(
        [BELT, 1.03 * BELT, 1.03 * BELT]
    )


@pytest.mark.parametrize(
    ("position", "belt", "why"),
    [
        (np.zeros(5000), FEED, "no decay is seen"),
        (1e-6 * np.round(np.cos(TIME / 0.01) * 0.9), FEED, "amplitude of 10 µm or more"),
        (4e-4 * np.sin(100.0 * TIME), FEED, "vibrates already"),
        (tapped(1.0, 16.0, 5e-5), 0.0 * FEED, "the belt is at rest"),
        (np.linspace(0.0, 1e-3, 40), FEED[:40], "no decay is seen"),
    ],
)
def test_without_a_ring_down_a_sentence_says_why(
    position: FloatArray, belt: FloatArray, why: str
) -> None:
    assert found(position, belt) == []
    assert why in why_no_ring_down(position, belt, PERIOD)


def test_a_limit_cycle_does_not_decay() -> None:
    grows = np.minimum(1e-6 * np.exp(2.0 * TIME), 1e-4) * np.sin(100.0 * TIME)
    assert all(each.decay_rate < 0.1 for each in found(grows))
