"""Following error and error at reversals, of motions that no model of the package has made."""

from math import acos, pi

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.following import Followed, followed
from tests.measures.records import behind_a_play

RADIUS, LAG = 0.05, 40e-6
OMEGA = 2.0 * pi * 0.25
TIME = np.arange(8000) / 500.0
CIRCLE = RADIUS * np.sin(OMEGA * TIME)
SPIKE, DECAY = 15e-6, 0.02
WIDTH = 2.4464 * DECAY
"""Between the roots of x exp(1 - x) = 1/2, 0.2320 and 2.6784."""


def told(time: FloatArray, reference: FloatArray, position: FloatArray) -> Followed:
    found = followed(time, reference, position)
    assert found is not None
    return found


def with_spikes(time: FloatArray, lag: float, sign: float = 1.0) -> FloatArray:
    """Return the circle with a spike after each reversal and a lag (m) at its largest speed."""
    error = lag * np.cos(OMEGA * time)
    for turn in range(8):
        since = np.maximum(time - (turn + 0.5) * pi / OMEGA, 0.0) / DECAY
        error += sign * (-1.0) ** (turn + 1) * SPIKE * since * np.exp(1.0 - since)
    return RADIUS * np.sin(OMEGA * time) - error


def test_a_play_stays_behind_and_rests_until_the_reference_is_through_it() -> None:
    found = told(TIME, CIRCLE, behind_a_play(CIRCLE, LAG))
    assert found.notes == []
    values = found.values
    assert values.peak_following_error == pytest.approx(LAG)
    assert values.rms_following_error == pytest.approx(LAG, rel=0.01)
    assert (values.reversals, values.reversal_duration) == (8, None)
    assert values.reversal_height == pytest.approx(LAG)
    rest = acos(1.0 - 2.0 * LAG / RADIUS) / OMEGA
    assert values.reversal_rest == pytest.approx(rest, abs=2.0 / 500.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("lag", [0.0, 1e-3])
@pytest.mark.parametrize(("step", "noise"), [(0.0, 0.0), (1e-6, 0.0), (0.0, 5e-7)])
def test_a_spike_is_told_beside_a_lag_and_by_an_encoder(
    sign: float, lag: float, step: float, noise: float
) -> None:
    position = with_spikes(TIME, lag, sign)
    position += noise * np.random.default_rng(7).standard_normal(len(TIME))
    position = np.round(position / step) * step if step else position
    found = told(TIME, CIRCLE, position)
    assert found.values.reversal_height == pytest.approx(SPIKE, rel=0.05)
    assert found.values.reversal_duration == pytest.approx(WIDTH, rel=0.05)
    assert found.values.reversal_rest is None
    error = found.values.reversal_height_error
    assert error is not None
    assert error < (5e-7 if step or noise else 1e-7)
    assert found.values.peak_following_error == pytest.approx(max(lag, SPIKE), rel=0.15)


def test_a_held_reference_is_the_line_between_its_changes() -> None:
    held = CIRCLE[np.arange(len(TIME)) // 5 * 5]
    found = told(TIME, held, with_spikes(TIME, 0.0))
    assert found.values.reversal_height == pytest.approx(SPIKE, rel=0.3)


@pytest.mark.parametrize(
    ("reference", "position", "reversals", "note"),
    [
        (CIRCLE, np.round(with_spikes(TIME, 0.0) / 1e-5) * 1e-5, 8, "positions tell none below"),
        (np.sign(CIRCLE + 1e-9), 0.99 * np.sign(CIRCLE + 1e-9), 0, "jumps"),
        (CIRCLE, np.zeros(len(TIME)), 8, "positions tell none below 100 nm"),
        (0.01 * TIME, 0.01 * TIME - LAG, 0, ""),
        (np.zeros(len(TIME)), np.full(len(TIME), LAG), 0, ""),
    ],
    ids=["coarse", "steps", "stands", "one way", "rest"],
)
def test_what_cannot_be_told_is_unknown(
    reference: FloatArray, position: FloatArray, reversals: int, note: str
) -> None:
    found = told(TIME, reference, position)
    values = found.values
    assert (values.reversals, values.reversal_height, values.reversal_rest) == (
        reversals,
        None,
        None,
    )
    assert note in "; ".join(found.notes)
    assert bool(found.notes) is bool(note)


def test_a_spike_between_two_samples_is_unknown() -> None:
    slow = TIME[::40]
    found = told(slow, RADIUS * np.sin(OMEGA * slow), with_spikes(slow, 0.0))
    assert found.values.reversal_height is None
    assert "shorter than three samples" in found.notes[0]
    assert followed(TIME, np.full(len(TIME), np.nan), CIRCLE) is None


def test_the_start_and_a_wrong_scale_are_no_errors_at_reversals() -> None:
    position = 1.002 * CIRCLE + with_spikes(TIME, 0.0) - CIRCLE
    late = np.exp(-TIME / 0.1)
    found = told(TIME, CIRCLE, position - 1e-2 * late)
    assert found.values.reversal_height == pytest.approx(SPIKE, rel=0.02)
    peak = 2e-3 * RADIUS + SPIKE
    assert found.values.peak_following_error == pytest.approx(peak, rel=0.15)


@pytest.mark.filterwarnings("error")
def test_a_fast_way_to_the_start_does_not_hide_the_lag() -> None:
    way = -0.2 * np.clip(1.0 - TIME / 0.1, 0.0, 1.0)
    found = told(TIME, CIRCLE + way, with_spikes(TIME, 1e-3) + way)
    assert found.values.reversal_height == pytest.approx(SPIKE, rel=0.02)


@pytest.mark.parametrize(("lag", "is_known"), [(0.0, True), (1e-3, False)])
def test_at_a_single_speed_a_lag_is_not_told_as_an_error_at_reversals(
    lag: float, is_known: bool
) -> None:
    triangle = RADIUS * np.arcsin(np.sin(OMEGA * TIME))
    behind = np.interp(TIME - lag / (RADIUS * OMEGA), TIME, triangle)
    found = told(TIME, triangle, behind - CIRCLE + with_spikes(TIME, 0.0))
    assert found.values.peak_following_error == pytest.approx(max(lag, SPIKE), rel=0.1)
    assert (found.values.reversal_height is not None) == is_known
    if is_known:
        assert found.values.reversal_height == pytest.approx(SPIKE, rel=0.1)
    else:
        assert found.notes[-1].endswith("at a single speed it may be a lag")


def test_the_standard_error_is_that_of_the_mean_over_reversals() -> None:
    time = TIME[TIME < 6.5]  # reversals at 1, 3 and 5 s
    reference, whole = RADIUS * np.sin(OMEGA * time), with_spikes(time, 0.0)
    error = (reference - whole) * np.select([time < 2.0, time < 4.0], [1.0, 2.0], 3.0)
    found = told(time, reference, reference - error)
    assert found.values.reversal_height == pytest.approx(2.0 * SPIKE, rel=0.02)
    assert found.values.reversal_height_error == pytest.approx(SPIKE / 3.0**0.5, rel=0.05)
