"""The noise of a record, found from it whatever the motion, and impulses of single samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.measures.noise import encoder_step, impulses, white_noise


def motion(samples_per_cycle: float) -> np.ndarray:
    return np.sin(2.0 * np.pi * np.arange(4000) / samples_per_cycle)


@given(st.floats(25.0, 500.0), st.floats(1e-6, 0.1), st.integers(0, 1000))
def test_noise_is_found_below_a_motion(cycle: float, deviation: float, seed: int) -> None:
    """Within 15 %: the median of 4000 values is good to 3 %, the motion adds less."""
    noise = deviation * np.random.default_rng(seed).standard_normal(4000)
    assert white_noise(motion(cycle) + noise) == pytest.approx(deviation, rel=0.15)


@given(st.floats(8.0, 500.0))
def test_a_motion_without_noise_has_none(cycle: float) -> None:
    assert white_noise(motion(cycle)) < 1e-7


def test_rounding_of_a_moving_slide_is_noise() -> None:
    """A uniform deviation of one step: the root of a twelfth."""
    told = np.round(motion(60.0) / 1e-3) * 1e-3
    assert white_noise(told) == pytest.approx(1e-3 / 12.0**0.5, rel=0.15)


def test_impulses_leave_the_noise_as_it_is() -> None:
    random = np.random.default_rng(3)
    noise = 1e-3 * random.standard_normal(4000)
    told = motion(60.0) + noise
    far = random.choice(np.arange(10, 3990, 10), 100, replace=False)
    told[far] += 0.2 * random.choice([-1.0, 1.0], 100)
    assert white_noise(told) == pytest.approx(1e-3, rel=0.35)
    found = impulses(told, 1e-3)
    assert np.flatnonzero(found).tolist() == sorted(far.tolist())


def test_a_short_record_has_no_noise() -> None:
    assert white_noise(np.random.default_rng(0).standard_normal(31)) == 0.0
    assert not impulses(np.array([0.0, 1.0, 0.0]), 1e-3).any()


@given(st.floats(1e-9, 1e-3), st.integers(-1000, 1000), st.integers(1, 300))
def test_the_step_of_an_encoder_is_that_of_its_levels(step: float, offset: int, reach: int) -> None:
    """Any other level is a whole number of steps away; a signal of more digits has none."""
    random = np.random.default_rng(reach)
    levels = np.append(random.integers(0, reach, 100), [0, 1])
    assert encoder_step((levels + offset) * step) == pytest.approx(step, rel=1e-6)
    assert encoder_step((levels + 0.1 * random.random(102)) * step) == 0.0
    assert encoder_step(np.full(100, step)) == encoder_step(np.empty(0)) == 0.0
