from typing import Any

import numpy as np
import pytest

from stickslip_ros.model.control import Pid, ResetIntegral
from tests.model.control.answers import answers, assert_same, random_record

GAINS: dict[str, Any] = {"position_gain": 3e5, "integral_gain": 4e6, "velocity_gain": 2e3}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("share", "band"), [(1.0, 0.0), (0.4, 5e-4), (0.0, 1e-3)])
def test_the_integral_turns_where_the_error_changes_its_sign(
    seed: int, share: float, band: float
) -> None:
    record = random_record(seed)
    error = record.error
    outside = np.abs(error) > band
    last = np.maximum.accumulate(np.where(outside, np.arange(len(error)), -1))
    side = np.where(last < 0, 0.0, np.sign(error[last]))
    turns = np.concatenate([[False], side[1:] * side[:-1] < 0.0])
    # Each share of the integral is turned at every later change of sign.
    later = [
        sum(
            4e6 * record.elapsed[k] * error[k] * np.prod(np.where(turns[k + 1 : n + 1], -share, 1))
            for k in range(n + 1)
        )
        for n in range(len(error))
    ]
    expected = 3e5 * error + np.array(later) + 2e3 * record.rate
    found = answers(ResetIntegral(**GAINS, reset_share=share, reset_band=band), record)
    assert_same(found, expected)
    assert turns.sum() > 10


def test_it_has_no_linear_form_but_that_of_its_pid_control() -> None:
    law = ResetIntegral(**GAINS)
    assert law.linear_feedback(1e-3) is None
    for part, expected in zip(
        law.linear_part(1e-3), Pid(**GAINS).linear_feedback(1e-3) or (), strict=True
    ):
        np.testing.assert_array_equal(part, expected)
