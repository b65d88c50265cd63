import numpy as np
import pytest

from stickslip_ros.studies.case_outcome import hunting, settling_time

RATE = 1000.0
TIME = np.arange(5000) / RATE


def test_a_vibration_about_the_reference_has_amplitude_and_period() -> None:
    amplitude, period = hunting(2e-3 * np.sign(np.sin(2.0 * np.pi * TIME / 0.8)), 1e-4, RATE)
    assert amplitude == pytest.approx(2e-3)
    assert period == pytest.approx(0.8, abs=2e-3)


@pytest.mark.parametrize("error", [np.full(5000, 1e-3), 1e-5 * np.sin(40.0 * TIME), 1e-3 * TIME])
def test_an_error_that_rests_is_small_or_creeps_is_no_hunting(error: np.ndarray) -> None:
    assert hunting(error, 1e-4, RATE) == (0.0, None)


def test_the_settling_time_ends_with_the_last_large_distance() -> None:
    distance = np.exp(-(TIME - 1.0) / 0.1)
    assert settling_time(distance, 0.05, 1.0, RATE) == pytest.approx(0.1 * np.log(20.0), abs=1e-3)
    assert settling_time(distance, 0.05, 4.0, RATE) == 0.0
    assert settling_time(distance[::-1], 0.05, 1.0, RATE) is None
