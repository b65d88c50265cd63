from collections.abc import Sequence
from math import isfinite

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from stickslip_ros.model.control import Washout
from stickslip_ros.motion.controller import Controller
from stickslip_ros.samples import Sample

SECOND = 10**9

measurements = st.lists(
    st.tuples(st.integers(1, 2 * SECOND), st.floats(-2.0, 2.0)), min_size=1, max_size=20
)


def at(stamp: int, velocity: float) -> Sample:
    return Sample(stamp, 0.0, velocity, 0.0, 0.0, 0.0)


def filtered(corner_frequency: float, steps: Sequence[tuple[int, float]]) -> list[float]:
    """V = y - d w with w' = y - d w from rest, each y held until the next one.

    The pair (w, y) with y' = 0 is linear: its matrix exponential takes it from one to the next.
    """
    matrix = np.array([[-corner_frequency, 1.0], [0.0, 0.0]])
    state = np.array([steps[0][1] / corner_frequency, steps[0][1]])
    outputs = []
    for number, (step, speed) in enumerate(steps):
        if number > 0:
            state = expm(matrix * step * 1e-9) @ state
        state[1] = speed
        outputs.append(float(speed - corner_frequency * state[0]))
    return outputs


@given(st.floats(0.01, 100.0), measurements)
def test_the_force_is_linear_and_cubic_in_the_exactly_filtered_velocity(
    corner_frequency: float, steps: list[tuple[int, float]]
) -> None:
    washout = Controller(Washout(corner_frequency, linear_gain=-3.0, cubic_gain=-5.0))
    stamp = 0
    answers = []
    for step, speed in steps:
        stamp += step
        answers.append(washout.answer(at(stamp, speed)))
    outputs = np.array(filtered(corner_frequency, steps))
    assert answers == pytest.approx(-3.0 * outputs - 5.0 * outputs**3, rel=1e-9, abs=1e-9)


@given(
    st.lists(
        st.tuples(st.integers(-(2**61), 2**61), st.floats(-1e100, 1e100)), min_size=1, max_size=20
    ),
    st.floats(1e-300, 1e300),
)
def test_no_stamp_and_no_speed_leaves_it_with_a_filter_that_is_not_finite(
    steps: list[tuple[int, float]], corner_frequency: float
) -> None:
    washout = Controller(Washout(corner_frequency, -1.0, 0.0))
    for stamp, speed in steps:
        force = washout.answer(at(stamp, speed))
        assert force is None or isfinite(force)
