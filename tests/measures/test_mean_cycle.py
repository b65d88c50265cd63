"""The mean cycle: period, drift, cycle by cycle, of motions in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.measures.mean_cycle import FoldedCycles
from tests.examples import examples

PERIOD, COUNT = 0.06247, 20


def folded(
    guess: float = PERIOD, drift: float = 0.0, growth: float = 0.0, noise: float = 1e-8
) -> FoldedCycles:
    """Return 20 cycles of a sine with a third harmonic, at 1 kHz, with noise."""
    time = np.arange(0.0, COUNT * PERIOD, 1e-3)
    turn = 2.0 * np.pi * time / PERIOD
    shape = np.sin(turn) + 0.1 * np.cos(3.0 * turn)
    size = 1e-4 * (1.0 + growth * (time / time[-1] - 0.5))
    position = size * shape + drift * time
    position += noise * np.random.default_rng(0).standard_normal(len(time))
    return FoldedCycles(time, position, COUNT, guess, 0.0)


@examples(quick=5, thorough=25)
@given(st.floats(-0.004, 0.004))
def test_the_period_is_found_from_a_guess(wrong: float) -> None:
    fold, shape = folded(guess=PERIOD * (1.0 + wrong)).smoothed()
    assert fold.period == pytest.approx(PERIOD, rel=1e-6)
    error = fold.period_error(shape, fold.position - shape.value(fold.phase))
    assert abs(fold.period - PERIOD) < 5.0 * error < 1e-6 * PERIOD


def test_values_and_velocities_are_those_of_the_motion() -> None:
    _, shape = folded().smoothed()
    phase = np.linspace(0.0, PERIOD, 50)
    turn, rate = 2.0 * np.pi * phase / PERIOD, 2.0 * np.pi / PERIOD
    assert shape.value(phase) == pytest.approx(
        1e-4 * (np.sin(turn) + 0.1 * np.cos(3.0 * turn)), abs=1e-8
    )
    assert shape.velocity(phase) == pytest.approx(
        1e-4 * rate * (np.cos(turn) - 0.3 * np.sin(3.0 * turn)), abs=1e-5
    )


@pytest.mark.parametrize("drift", [0.0, 1e-5, -1e-4])
def test_a_drift_is_taken_out(drift: float) -> None:
    fold = folded(drift=drift)
    taken = fold.position - fold.smoothed()[0].position
    assert np.polyfit(fold.time, taken, 1)[0] == pytest.approx(drift, rel=0.02, abs=1e-12)
    assert taken.mean() == pytest.approx(0.0, abs=1e-3 * abs(drift) + 1e-12)


def test_each_cycle_has_its_amplitude() -> None:
    """It grows by a tenth over the cycles, from 0.95 on."""
    fold, shape = folded(growth=0.1).smoothed()
    relative = fold.relative_amplitudes(shape, fold.position - shape.value(fold.phase))
    expected = 0.95 + 0.1 * (np.arange(COUNT) + 0.5) / COUNT
    assert relative == pytest.approx(expected, abs=2e-3)
