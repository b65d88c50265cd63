from typing import Any

import numpy as np
import pytest

from stickslip_ros.model.control import Pid
from tests.model.control.answers import answers, assert_same, random_record

GAINS: dict[str, Any] = {"position_gain": 3e5, "integral_gain": 4e6, "velocity_gain": 2e3}


@pytest.mark.parametrize("seed", range(5))
def test_without_a_limit_it_is_the_sum_of_three_terms(seed: int) -> None:
    record = random_record(seed)
    integral = np.cumsum(record.elapsed * record.error)
    expected = 3e5 * record.error + 4e6 * integral + 2e3 * record.rate
    assert_same(answers(Pid(**GAINS), record), expected)


@pytest.mark.parametrize("seed", range(5))
def test_at_the_limit_the_integral_follows_what_is_left(seed: int) -> None:
    record = random_record(seed)
    integral, expected = 0.0, []
    for step, error, rate in zip(record.elapsed, record.error, record.rate, strict=True):
        integral += 4e6 * step * error
        force = 3e5 * error + integral + 2e3 * rate
        left = np.clip(force, -300.0, 300.0)
        integral += (1.0 - np.exp(-step / 0.02)) * (left - force)
        expected.append(left)
    law = Pid(**GAINS, tracking_time=0.02, force_limit=300.0)
    found = answers(law, record)
    assert_same(found, np.array(expected))
    assert np.count_nonzero(np.abs(found) == 300.0) > 20


def test_anti_windup_leaves_the_limit_soon_after_a_long_error() -> None:
    """Ten seconds at the limit, then an error of the other sign: one that waits is still there."""
    error = np.where(np.arange(10_100) < 10_000, 1e-3, -1e-4)
    record = random_record(0, count=10_100)._replace(
        position=-error, velocity=np.zeros(10_100), reference=np.zeros((3, 10_100))
    )
    law = Pid(position_gain=1e5, integral_gain=1e6, velocity_gain=0.0, force_limit=50.0)
    assert answers(law, record)[-1] < 40.0
