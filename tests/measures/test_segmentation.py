"""Rests and slips that are not those of a simulated drive, as machines record them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.measures.sample_assumptions import UNKNOWN
from stickslip_ros.measures.segmentation import stick_slip
from stickslip_ros.record.report import report_of_recording
from tests.measures.records import columns, fed, milliseconds

PERIOD, TRAVEL, SLIP, STEP = 0.7, 1e-3, 0.2, 2e-6
STAMPS = milliseconds(8000)


def stairs(time: FloatArray, over: float = 0.0, uneven: float = 0.0) -> FloatArray:
    """Rests, and slips by a travel within `SLIP`, which may go too far first; m.

    Rests are longer and shorter by turns by an `uneven` share, as the travel after them.
    """
    position = np.zeros(len(time))
    for number in range(round(time[-1] / PERIOD) + 2):
        late = uneven * PERIOD * (number % 2)
        u = np.clip((time - number * PERIOD - late) / SLIP, 0.0, 1.0)
        slip = (1.0 - np.cos(np.pi * u)) / 2.0
        if over:
            slip = (
                np.where(u < 0.5, 0.0, 1.0)
                + np.where(u < 0.5, 1.0 + over, over) * (1.0 - np.cos(2.0 * np.pi * u)) / 2.0
            )
        position += slip * TRAVEL * (1.0 - uneven if number % 2 else 1.0 + uneven)
    return position


def late(time: FloatArray) -> FloatArray:
    """Return times of which a twentieth is late by most of a sample period."""
    return time + 7e-4 * (np.random.default_rng(1).random(len(time)) < 0.05)


def dropped(time: FloatArray) -> FloatArray:
    """Return nineteen of twenty times."""
    return time[np.random.default_rng(1).random(len(time)) > 0.05]


@pytest.mark.parametrize("over", [0.0, 0.03, 0.08, 0.2, 0.5])
@pytest.mark.parametrize("noise", [0.0, STEP])
def test_a_slip_that_overshoots_ends_when_it_has_come_back(over: float, noise: float) -> None:
    time = STAMPS * 1e-9
    position = stairs(time, over) + noise * np.random.default_rng(1).standard_normal(len(time))
    found = stick_slip(time, np.round(position / STEP) * STEP, 0.0, 20, STEP)
    assert found is not None
    assert found.rests
    assert found.cycle.period == pytest.approx(PERIOD, rel=1e-3)
    assert found.cycle.stick_fraction == pytest.approx(1.0 - SLIP / PERIOD, abs=0.02)


@pytest.mark.parametrize("every", [1, 2, 4])
def test_the_amplitude_between_corners_is_within_its_error(every: int) -> None:
    time = STAMPS[::every] * 1e-9
    slips = np.clip(time % PERIOD / SLIP, 0.0, 1.0)
    position = TRAVEL * (time // PERIOD + slips)
    found = stick_slip(time, np.round(position / STEP) * STEP, 0.0, 20, STEP)
    assert found is not None
    amplitude, error = found.cycle.amplitude, found.errors.amplitude
    assert abs(amplitude - TRAVEL * (1.0 - SLIP / PERIOD) / 2.0) < 3.0 * error < 0.06 * amplitude


@pytest.mark.parametrize("times", [late, dropped])
@pytest.mark.parametrize("uneven", [0.0, 0.3])
def test_rests_by_turns_and_stamps_that_are_uneven_change_little(
    times: Callable[[FloatArray], FloatArray], uneven: float
) -> None:
    time = times(STAMPS * 1e-9)
    found = stick_slip(time, np.round(stairs(time, 0.0, uneven) / STEP) * STEP, 0.0, 20, STEP)
    assert found is not None
    assert found.rests
    assert found.cycle.period == pytest.approx(PERIOD, rel=0.05)
    assert found.cycle.stick_fraction == pytest.approx(1.0 - SLIP / PERIOD, abs=0.02)


@pytest.mark.parametrize("belt", [0.0, TRAVEL / PERIOD])
def test_a_push_within_a_rest_that_comes_back_leaves_the_cycles(belt: float) -> None:
    time = 1e-9 * STAMPS
    push = 0.15 * TRAVEL * np.sin(np.pi * np.clip((time % PERIOD - 0.45) / 0.02, 0.0, 1.0)) ** 2
    position = np.round((stairs(time) + push) / 1e-5) * 1e-5 + belt * time
    found = stick_slip(time, position, belt, 20, 1e-5)
    assert found is not None
    assert found.cycle.period == pytest.approx(PERIOD, rel=0.01)
    assert found.cycle.stick_fraction == pytest.approx(1.0 - (SLIP + 0.02) / PERIOD, abs=0.03)


@pytest.mark.parametrize("share", [0.005, -0.02])
def test_a_drift_that_ends_leaves_the_rests(share: float) -> None:
    """Of this share of the feed at the start: no belt velocity suits all rests."""
    time = 1e-9 * STAMPS
    noise = 2e-7 * np.random.default_rng(1).standard_normal(len(time))
    drift = share * TRAVEL / PERIOD * 3.0 * (1.0 - np.exp(-time / 3.0))
    found = stick_slip(time, stairs(time) + drift + noise, 0.0, 20, 0.0)
    assert found is not None
    assert found.rests
    assert found.cycle.stick_fraction == pytest.approx(1.0 - SLIP / PERIOD, abs=0.03)


@pytest.mark.parametrize("drift", [0.005, -0.01, 0.02])
@pytest.mark.parametrize("steps", [50, 200])
def test_a_rest_in_which_the_encoder_steps_once_is_a_single_one(drift: float, steps: int) -> None:
    time = 1e-9 * STAMPS
    position = stairs(time) + drift * TRAVEL / PERIOD * time
    step = TRAVEL / steps
    found = stick_slip(time, np.round(position / step) * step, 0.0, 20, step)
    assert found is not None
    assert found.cycle.stick_fraction == pytest.approx(1.0 - SLIP / PERIOD, abs=0.06)


@pytest.mark.parametrize("creep", [0.03, 0.05, 0.09])
@pytest.mark.parametrize(("over", "uneven"), [(0.0, 0.0), (0.3, 0.2)])
def test_a_contact_that_creeps_before_it_slips_has_no_false_stick_fraction(
    creep: float, over: float, uneven: float
) -> None:
    """In the second half of a rest the slide creeps, faster and faster."""
    time, rest = 1e-9 * STAMPS, 1.0 - SLIP / PERIOD
    second_half = np.clip(2.0 * (time % PERIOD - SLIP) / (PERIOD - SLIP) - 1.0, 0.0, 1.0)
    position = stairs(time, over, uneven)
    position += creep * TRAVEL * (np.floor(time / PERIOD) + second_half**2)
    feed = (1.0 + creep) * TRAVEL / PERIOD
    meter = fed(columns(STAMPS, feed * time - position, belt_velocity=1.02 * feed), UNKNOWN)
    measures = meter.measures()
    if measures.regime is not None:
        assert measures.errors is not None
        assert measures.stick_fraction is not None
        margin = 3.0 * measures.errors["stick_fraction"]
        assert rest / 2.0 - margin < measures.stick_fraction < rest + margin


@pytest.mark.parametrize("samples", [24, 32, 48])
def test_slips_of_few_samples_under_noise_have_their_errors(samples: int) -> None:
    """What is hidden in the noise of a slip is part of its duration."""
    time = PERIOD / samples * 1.01 * np.arange(12 * samples)
    noise = np.random.default_rng(1).standard_normal(len(time)) * TRAVEL / 12.0
    found = stick_slip(time, stairs(time) + noise, 0.0, 20, 0.0)
    assert found is not None
    error = found.cycle.stick_fraction - (1.0 - SLIP / PERIOD)
    assert abs(error) < 2.0 * found.errors.stick_fraction < 0.3


@pytest.mark.parametrize("start", [150, 250, 400, 600, 650])
def test_a_capture_of_one_and_a_half_periods_has_no_false_regime(start: int) -> None:
    time = STAMPS[: round(1500.0 * PERIOD)] * 1e-9
    seen = np.round(stairs(time + start * 1e-3) / 1.6e-5) * 1.6e-5
    feed = TRAVEL / PERIOD
    measures = fed(columns(STAMPS[: len(time)], feed * time - seen, None, feed), UNKNOWN).measures()
    assert measures.regime in (None, Regime.STICK_SLIP)


def test_a_slide_on_a_belt_whose_velocity_is_told_wrong_rests_on_another_guide() -> None:
    time = 1e-9 * STAMPS[:3150]
    noise = 2e-6 * np.random.default_rng(1).standard_normal(len(time))
    lag = TRAVEL / PERIOD * time - stairs(time + 0.3) + noise
    meter = fed(columns(STAMPS[:3150], lag, belt_velocity=0.93 * TRAVEL / PERIOD), UNKNOWN)
    assert meter.other_guide is not None
    velocity, share = meter.other_guide
    assert velocity == pytest.approx(TRAVEL / PERIOD, rel=0.05)
    assert share == pytest.approx(1.0 - SLIP / PERIOD, abs=0.06)


def test_an_uneven_belt_or_an_earlier_stick_slip_is_no_other_guide() -> None:
    random, time = np.random.default_rng(1), 1e-9 * STAMPS
    feed = TRAVEL / PERIOD
    lag = feed * time - stairs(time + 0.3) + 1e-6 * random.standard_normal(len(time))
    uneven = feed * (1.0 + 1e-3 * random.standard_normal(len(time)))
    assert fed(columns(STAMPS, lag, None, uneven), UNKNOWN).other_guide is None
    slips = np.where(time < 0.7 * time[-1], lag, 2e-5 * np.sin(30.0 * time))
    assert fed(columns(STAMPS, slips, belt_velocity=feed), UNKNOWN).other_guide is None


@pytest.mark.parametrize(("frequency", "shift"), [(35.3, 0.0), (50.3, 0.45)])
def test_a_vibration_on_a_larger_motion_is_no_cycle(frequency: float, shift: float) -> None:
    time = 1e-9 * STAMPS
    noise = 2e-6 * np.random.default_rng(1).standard_normal(len(time))
    ripple = 0.1 * TRAVEL * np.sin(2.0 * np.pi * frequency * time)
    lag = TRAVEL / PERIOD * time - stairs(time + shift) + ripple + noise
    measures = fed(columns(STAMPS, lag, belt_velocity=TRAVEL / PERIOD), UNKNOWN).measures()
    assert (measures.regime, measures.amplitude, measures.period) == (None, None, None)


def test_the_error_of_an_amplitude_has_the_extremes_of_the_noise() -> None:
    time = 1e-9 * STAMPS[::10]
    noise = 0.05 * TRAVEL * np.random.default_rng(1).standard_normal(len(time))
    exact, noisy = (stick_slip(time, stairs(time) + by, 0.0, 20, 0.0) for by in (0.0, noise))
    assert exact is not None
    assert noisy is not None
    apart = noisy.cycle.amplitude - exact.cycle.amplitude
    assert 0.1 * exact.cycle.amplitude < apart < 2.0 * noisy.errors.amplitude


def test_a_motion_that_repeats_nothing_has_no_regime_and_a_reason(tmp_path: Path) -> None:
    time = 0.01 * np.arange(800)
    velocity = np.array([0.0, 1.0, 0.1, 0.6, 0.0, 0.9, 0.2, 0.5])[np.arange(800) // 100]
    np.savetxt(tmp_path / "turns.csv", np.c_[time, 1e-4 * np.cumsum(velocity)], delimiter=",")
    report = report_of_recording(tmp_path / "turns.csv", {"time": "#1", "position": "#2"})
    assert report["regime"] is None
    assert any("nor repeats one vibration" in note for note in report["notes"])


def test_where_noise_hides_a_rest_at_the_turns_there_is_no_regime() -> None:
    course = np.clip(1.1 * np.sin(2.0 * np.pi * 1e-9 * STAMPS / PERIOD), -1.0, 1.0)
    noise = 5e-5 * np.random.default_rng(1).standard_normal(len(STAMPS))
    measures = fed(columns(STAMPS, TRAVEL * course + noise, belt_velocity=0.0), UNKNOWN).measures()
    assert measures.regime is None
    assert measures.period == pytest.approx(PERIOD, rel=0.01)
