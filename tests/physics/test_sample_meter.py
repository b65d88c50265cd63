from dataclasses import replace
from functools import cache
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.physics.measures import Regime
from stickslip_ros.physics.motion import Motion
from stickslip_ros.physics.samples import SampleMeter
from tests.physics.drives import LIMIT_CYCLES, PAPER

SECOND = 10**9


class Samples(NamedTuple):
    stamp: npt.NDArray[np.int64]
    position: npt.NDArray[np.float64]
    velocity: npt.NDArray[np.float64]
    belt_velocity: npt.NDArray[np.float64]

    def rows(self, rows: slice | npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> Self:
        return type(self)(*(column[rows] for column in self))

    def later(self, nanoseconds: int) -> Self:
        return self._replace(stamp=self.stamp + nanoseconds)


@cache
def limit_cycle(belt_speed: float = 0.2) -> Samples:
    """The paper's drive at 100 Hz from 1 s on, on its limit cycle."""
    drive = replace(PAPER, belt_speed=belt_speed)
    motion = Motion(drive, 0.0, 0.0)
    motion.advance(1000.0)
    rows = [(motion.position, motion.velocity)]
    for _ in range(7000):
        motion.advance(0.01)
        rows.append((motion.position, motion.velocity))
    position, velocity = np.array(rows).T
    return Samples(stamps(100, len(rows)), position, velocity, np.full(len(rows), belt_speed))


def stamps(rate: int, count: int, start: int = SECOND) -> npt.NDArray[np.int64]:
    return np.array([start + (n * SECOND + rate // 2) // rate for n in range(count)])


def still(stamp: npt.NDArray[np.int64]) -> Samples:
    """A slide that rests while the belt moves, at those stamps."""
    rest = np.zeros(len(stamp))
    return Samples(stamp, rest, rest, rest + 1.0)


def in_blocks(first: Samples, second: Samples, blocks: int) -> list[Samples]:
    """One after the other, as one block or as two."""
    if blocks == 2:
        return [first, second]
    return [Samples(*map(np.concatenate, zip(first, second, strict=True)))]


def test_measures_of_a_limit_cycle() -> None:
    meter = SampleMeter(window=20)
    cycles = meter.feed(*limit_cycle())
    measures = meter.measures()
    (expected,) = (cycle for cycle in LIMIT_CYCLES if cycle.belt_speed == 0.2)
    assert len(cycles) == measures.cycles == 9  # of 7.07 s in 70 s
    assert measures.regime is Regime.STICK_SLIP
    assert measures.amplitude == pytest.approx(expected.amplitude, rel=1e-8)
    assert measures.velocity_amplitude == pytest.approx(expected.velocity_amplitude, rel=1e-8)
    assert measures.midpoint == pytest.approx(expected.midpoint, rel=1e-8)
    assert measures.period == pytest.approx(expected.period, rel=1e-8)
    assert measures.stick_fraction == pytest.approx(expected.stick_fraction, abs=1e-5)
    assert meter.samples == 7001
    assert meter.lost_samples == 0
    assert meter.duration == pytest.approx(70.0, rel=1e-15)


@given(st.lists(st.integers(1, 7000), max_size=12).map(sorted))
def test_the_size_of_the_blocks_does_not_matter(starts: list[int]) -> None:
    whole, in_blocks = SampleMeter(window=20), SampleMeter(window=20)
    samples = limit_cycle()
    expected = whole.feed(*samples)
    cycles = []
    for start, end in zip([0, *starts], [*starts, 7001], strict=True):
        cycles += in_blocks.feed(*samples.rows(slice(start, end)))
    assert len(cycles) == len(expected)
    for cycle, expected_cycle in zip(cycles, expected, strict=True):
        # Time is counted from the start of a block; adding it up rounds.
        assert cycle == pytest.approx(expected_cycle, rel=1e-9)
    assert in_blocks.samples == whole.samples
    assert in_blocks.lost_samples == 0
    assert in_blocks.duration == whole.duration


# 3, 7 and 30 Hz have periods that are no whole number of nanoseconds.
rates = st.sampled_from([3, 7, 30, 100, 1000, 100_000])


@given(rates, st.sets(st.integers(2, 198)), st.lists(st.integers(2, 200), max_size=5).map(sorted))
def test_what_is_lost_is_counted_exactly(rate: int, lost: set[int], starts: list[int]) -> None:
    """From the stamps alone; the first two samples came, so that the period is known."""
    kept = np.array([n for n in range(200) if n not in lost])
    samples = still(stamps(rate, 200)).rows(kept)
    meter = SampleMeter(window=20)
    for start, end in zip([0, *starts], [*starts, 200], strict=True):
        meter.feed(*samples.rows((kept >= start) & (kept < end)))
    assert meter.samples == len(kept)
    assert meter.lost_samples == len(lost)


def test_a_loss_at_the_start_is_counted_once_the_period_is_known() -> None:
    meter = SampleMeter(window=20)
    meter.feed(*still(stamps(1000, 10)).rows(np.array([0, 2])))
    meter.feed(*still(stamps(1000, 10)).rows(np.array([3, 4, 5])))
    assert meter.lost_samples == 1


def test_measures_bridge_what_was_lost() -> None:
    samples = limit_cycle()
    kept = np.random.default_rng(1).random(len(samples.stamp)) > 0.1
    kept[:2] = True
    whole, holed = SampleMeter(window=20), SampleMeter(window=20)
    whole.feed(*samples)
    holed.feed(*samples.rows(kept))
    assert holed.lost_samples == np.count_nonzero(~kept[: np.flatnonzero(kept)[-1]])
    expected, measures = whole.measures(), holed.measures()
    assert measures.cycles == expected.cycles
    assert measures.amplitude == pytest.approx(expected.amplitude, rel=1e-6)
    assert measures.period == pytest.approx(expected.period, rel=1e-6)
    assert measures.stick_fraction == pytest.approx(expected.stick_fraction, abs=1e-3)


def test_no_cycle_spans_a_long_gap() -> None:
    samples = limit_cycle()
    meter = SampleMeter(window=20)
    meter.feed(*samples.rows(slice(0, 3000)))
    cycles = meter.feed(*samples.rows(slice(3300, 7001)))
    assert meter.lost_samples == 300
    assert [cycle.period for cycle in cycles] == pytest.approx([7.06772953] * len(cycles), rel=1e-6)


@pytest.mark.parametrize("gap", [1.2345678, 60.00004, 700.0005, 86400.0003])
def test_a_new_segment_is_no_loss(gap: float) -> None:
    """The gap is no whole number of periods of 1 ms, as after a pause in real time."""
    first = still(stamps(1000, 5000))
    meter = SampleMeter(window=20)
    meter.feed(*first)
    meter.feed(*first.later(4_999_000_000 + round(gap * SECOND)))
    assert meter.samples == 10_000
    assert meter.lost_samples == 0
    assert meter.duration == pytest.approx(2 * 4.999, rel=1e-15)


@pytest.mark.parametrize("rates", [(100, 1000), (1000, 100), (100, 150)])
@pytest.mark.parametrize("blocks", [1, 2])
def test_a_new_segment_may_have_another_rate(rates: tuple[int, int], blocks: int) -> None:
    first = still(stamps(rates[0], 100))
    second = still(stamps(rates[1], 100, start=int(first.stamp[-1]) + 1_234_567_800))
    meter = SampleMeter(window=20)
    for part in in_blocks(first, second, blocks):
        meter.feed(*part)
    assert meter.samples == 200
    assert meter.lost_samples == 0


@pytest.mark.parametrize("blocks", [1, 2])
def test_stamps_that_go_back_start_a_new_segment(blocks: int) -> None:
    samples = limit_cycle()
    twice = samples.rows(slice(0, 5000)), samples.rows(slice(1000, 6000))
    meter = SampleMeter(window=20)
    cycles = [cycle for part in in_blocks(*twice, blocks) for cycle in meter.feed(*part)]
    assert meter.samples == 10_000
    assert meter.lost_samples == 0
    assert [cycle.period for cycle in cycles] == pytest.approx([7.06772953] * len(cycles), rel=1e-6)
    assert len(cycles) >= 10


@pytest.mark.parametrize("column", ["position", "velocity", "belt_velocity"])
def test_rows_that_are_not_finite_are_lost(column: str) -> None:
    samples = limit_cycle()
    values = getattr(samples, column).copy()
    values[[10, 500, 501, 3000]] = [np.nan, np.inf, -np.inf, np.nan]
    meter = SampleMeter(window=20)
    cycles = meter.feed(*samples._replace(**{column: values}))
    assert meter.samples == 6997
    assert meter.lost_samples == 4
    assert len(cycles) == 9
    assert np.isfinite(cycles).all()


def test_nothing_but_rows_that_are_not_finite() -> None:
    meter = SampleMeter(window=20)
    samples = limit_cycle().rows(slice(0, 3))
    assert meter.feed(*samples._replace(velocity=np.full(3, np.nan))) == []
    assert meter.samples == 0
    assert meter.measures().regime is None


@pytest.mark.parametrize(("speed", "regime"), [(999.0, None), (1001.0, Regime.UNBOUNDED)])
def test_a_thousand_belt_speeds_are_running_away(speed: float, regime: Regime | None) -> None:
    samples = still(stamps(100, 3))._replace(velocity=np.array([0.0, -speed, speed]))
    meter = SampleMeter(window=20)
    meter.feed(*samples)
    assert meter.measures().regime is regime


def test_no_speed_is_running_away_over_a_belt_at_rest() -> None:
    samples = still(stamps(100, 3))._replace(
        velocity=np.array([0.0, 5.0, 6.0]), belt_velocity=np.zeros(3)
    )
    meter = SampleMeter(window=20)
    meter.feed(*samples)
    assert meter.measures().regime is None
