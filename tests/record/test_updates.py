"""Updates of a position that is recorded faster than it is updated."""

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.record.updates import updated

TIME = 1e-3 * np.arange(4000)
SINE = 1e-3 * np.sin(20.0 * TIME)
STAIRS = TIME // 0.1 + 10.0 * np.maximum(TIME % 0.1 - 0.09, 0.0)
NOISY = SINE + 1e-5 * np.random.default_rng(1).standard_normal(4000)


@pytest.mark.parametrize("rows", [2.0, 5.0, 7.8125, 14.1])
@pytest.mark.parametrize("lines", [False, True])
def test_updates_are_found_though_rows_are_lost(rows: float, lines: bool) -> None:
    at = 1e-3 * rows * np.arange(4000 // rows)
    last = np.searchsorted(at, TIME + 1e-9, "right") - 1
    shown = np.interp(TIME, at, np.sin(20.0 * at)) if lines else np.sin(20.0 * at)[last]
    kept = np.random.default_rng(1).random(4000) > 0.01
    every, own = updated(TIME[kept], [shown[kept], TIME[kept]])
    assert every == pytest.approx(rows, rel=0.01)
    late = (TIME[kept][own] - at[last][kept][own]) / 1e-3
    assert np.mean(np.minimum(late, rows - late) < 1.0) > 0.97


@pytest.mark.parametrize("value", [SINE, SINE.round(5), STAIRS, NOISY, np.zeros(4000)])
def test_a_position_that_is_as_fast_is_read_at_each_row(value: FloatArray) -> None:
    every, own = updated(TIME, [value])
    assert every == 1.0
    assert own.all()
