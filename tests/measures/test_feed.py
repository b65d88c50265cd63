"""The frame of a machine: a slide that advances on a guide at rest, less its mean feed."""

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.feed import last_feed, mean_feed, relative_to_feed
from stickslip_ros.measures.segmentation import stick_slip
from stickslip_ros.samples import SampleColumns
from tests.measures.records import columns, milliseconds

TIME = 1e-3 * np.arange(8000, dtype=np.float64)
STAMP = (1e6 * np.arange(8000)).astype(np.int64)
UNKNOWN, REST = np.full(8000, np.nan), np.zeros(8000)
PERIOD, STEP = 0.66, 6.6e-3


def stairs(time: FloatArray) -> FloatArray:
    """Sticks, and moves by a step within a quarter of each period."""
    number, phase = np.divmod(time / PERIOD, 1.0)
    share = np.clip(4.0 * (phase - 0.5), 0.0, 1.0)
    return STEP * (number + share - np.sin(2.0 * np.pi * share) / (2.0 * np.pi))


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("shift", [0.1, 0.3, 0.55])
def test_the_feed_is_that_over_whole_cycles(direction: float, shift: float) -> None:
    position = direction * stairs(TIME + shift)
    assert mean_feed(TIME, position) == pytest.approx(direction * 0.01, rel=2e-5)
    noisy = position + 1e-5 * np.random.default_rng(1).standard_normal(len(TIME))
    assert mean_feed(TIME, noisy) == pytest.approx(direction * 0.01, rel=1e-3)
    coarse = np.round(position / 5e-4) * 5e-4
    assert mean_feed(TIME, coarse) == pytest.approx(direction * 0.01, rel=3e-3)


@pytest.mark.parametrize(
    "position",
    [
        np.sin(9.0 * TIME),
        0.01 * TIME,
        0.01 * TIME + 0.01 * np.sin(9.0 * TIME),
        np.exp(-TIME) * np.sin(9.0 * TIME) + 0.01 * TIME,
        np.clip(np.abs(TIME % 4.0 - 2.0), 0.5, 1.5),
        stairs(np.minimum(TIME, 1.5)),
        np.zeros(8000),
    ],
)
def test_other_motions_have_no_feed(position: FloatArray) -> None:
    assert mean_feed(TIME, position) is None


def test_samples_relative_to_the_feed_stick_to_the_guide() -> None:
    position = stairs(TIME)
    velocity = np.gradient(position, TIME)
    samples = SampleColumns(STAMP, position, velocity, UNKNOWN, UNKNOWN, REST)
    moved, feed = relative_to_feed(samples)
    assert feed == pytest.approx(0.01, rel=2e-5)
    assert np.array_equal(moved.velocity == moved.belt_velocity, velocity == 0.0)
    assert np.ptp(moved.position) == pytest.approx(5.2e-3, rel=1e-3)
    on_belt = SampleColumns(STAMP, position, velocity, UNKNOWN, UNKNOWN, REST + 0.02)
    assert relative_to_feed(on_belt) == (on_belt, 0.0)


def test_of_feeds_one_after_the_other_the_last_one_counts() -> None:
    def samples(feeds: FloatArray) -> SampleColumns:
        travel = np.cumsum(feeds) * PERIOD / STEP * 1e-3
        return SampleColumns(STAMP, stairs(travel), REST, UNKNOWN, UNKNOWN, REST)

    one, two = np.full(8000, 0.02), np.where(TIME < 4.0, 0.04, 0.02)
    assert last_feed(samples(one)) == 0
    row = last_feed(samples(two))
    assert 4000 <= row < 4330  # within a cycle
    assert relative_to_feed(samples(two)[row:])[1] == pytest.approx(0.02, rel=1e-3)


def test_a_release_just_before_the_first_position_begins_no_cycle() -> None:
    found = stick_slip(TIME, stairs(TIME + 0.335), 0.0, 20, 0.0)
    assert found is not None
    assert found.cycle.period == pytest.approx(PERIOD, rel=1e-4)


def test_a_ripple_tells_no_other_feed() -> None:
    time = 1e-3 * np.arange(8150)
    wave = 4e-3 * (time + np.sin(5.0 * np.pi * time) / (5.0 * np.pi))
    ripple = 2.2e-5 * np.sin(2.0 * np.pi * 77.7 * time)
    samples = columns(milliseconds(8150), wave + ripple, belt_velocity=0.0)
    assert last_feed(samples) == 0
