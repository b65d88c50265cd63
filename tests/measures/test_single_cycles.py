"""Single cycles of positions with noise: their extremes, and what is measured between them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.signal import find_peaks

from stickslip_ros.measures import Measures, Regime
from stickslip_ros.measures.cycle_measures import Cycle, CycleMeans
from stickslip_ros.measures.noise import medians
from stickslip_ros.measures.sample_assumptions import EXACT, UNKNOWN, SampleAssumptions
from stickslip_ros.measures.sample_meter import SampleMeter
from stickslip_ros.measures.sample_window import Window, WindowMeter
from stickslip_ros.measures.single_cycles import NoisySamples, extreme_near, reversals
from stickslip_ros.measures.window_measures import rest
from tests.measures.records import columns, milliseconds


def samples(position: np.ndarray, step: float = 1e-3, belt: float = 0.04) -> NoisySamples:
    time = np.arange(len(position)) * step
    return NoisySamples(time, position, np.gradient(position, step), time * 0.0 + belt)


@given(st.integers(0, 10_000), st.floats(0.5, 4.0), st.integers(10, 300))
@example(250, 1.0, 207)
def test_reversals_are_the_peaks_of_this_prominence(seed: int, least: float, count: int) -> None:
    """Of the medians, two of which may be alike: by their heights, from a highest one on.

    Of two alike, with no way back between them, SciPy counts both.
    """
    random = np.random.default_rng(seed)
    position = np.cumsum(random.standard_normal(count))
    course = medians(position)[:-1]
    lows = np.array([low for _, low in reversals(position, least)], int)
    expected, _ = find_peaks(-course, prominence=least)
    expected = expected[expected >= lows.min(initial=count)]
    alike = [
        course[before] == course[after] and np.ptp(course[before : after + 1]) <= least
        for before, after in pairwise(expected)
    ]
    expected = np.delete(expected, 1 + np.flatnonzero(alike))
    assert course[lows].tolist() == course[expected].tolist()
    for high, low in reversals(position, least):
        assert course[high] - course[low] > least


@pytest.mark.parametrize(("amplitude", "regime"), [(150e-6, None), (1e-9, Regime.EQUILIBRIUM)])
def test_a_motion_of_few_samples_per_cycle_is_no_rest(
    amplitude: float, regime: Regime | None
) -> None:
    moving = samples(amplitude * np.sin(2.0 * np.pi * np.arange(200) / 6.7), step=0.01)
    window = Window(moving, (), (), None, 20, 200, 1e-6, 0.0)
    assert rest(moving, window, EXACT).regime is regime


@given(st.floats(0.2, 0.8), st.floats(-100.0, 100.0), st.integers(3, 9))
def test_the_vertex_of_a_parabola_is_found_between_its_samples(
    share: float, bend: float, reach: int
) -> None:
    time = (np.arange(21) - 10.0 - share) * 1e-3
    found = extreme_near(samples(0.5 + bend * time**2), 10, reach)
    assert found.time == pytest.approx(0.010 + share * 1e-3, abs=1e-9 if abs(bend) > 1e-3 else 1.0)
    assert found.position == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("feed", [-4e-3, 4e-3])
@pytest.mark.parametrize(
    ("step", "noise", "rest"), [(2e-6, 0, 0.85), (0, 1e-5, 0.85), (0, 1e-6, 0.3), (0, 1e-4, None)]
)
def test_each_cycle_of_a_creeping_axis_has_its_stick_or_none(
    feed: float, step: float, noise: float, rest: float | None
) -> None:
    """It rests for this share of each cycle, which large noise hides, and travels 3.2 mm in it."""
    time, share = np.arange(0.0, 8.0, 0.002), rest or 0.85
    turn = np.floor(time / 0.8)
    slip = np.maximum(time / 0.8 - turn - share, 0.0) / (1.0 - share)
    exact = 0.8 * abs(feed) * (turn + (1.0 - np.cos(np.pi * slip)) / 2.0 - time / 0.8)
    position = exact + noise * np.random.default_rng(1).standard_normal(len(time))
    if step:
        position = step * np.round(position / step)
    meter = SampleMeter(20, reading=SampleAssumptions(noisy=True))
    record = columns(2 * milliseconds(len(time)), np.sign(feed) * position, None, -feed)
    cycles = meter.feed(record)[2:]
    assert len(cycles) >= 6
    for cycle in cycles:
        assert cycle.period == pytest.approx(0.8, abs=0.04)
        assert cycle.amplitude == pytest.approx(np.ptp(exact) / 2.0, rel=0.05)
        assert cycle.stick_fraction == pytest.approx(rest or np.nan, abs=0.08, nan_ok=True)
    sticks = [cycle.stick_fraction for cycle in cycles]
    assert np.median(sticks) == pytest.approx(rest or np.nan, abs=0.04, nan_ok=True)


def test_an_axis_that_hunts_at_standstill_has_its_rests_in_each_cycle_with_exact_velocities() -> (
    None
):
    """To and fro on a guide at rest: of 1.6 s it moves in two times 60 ms."""
    time = np.arange(0.0, 16.0, 0.002)
    moved = np.minimum(time % 0.8 / 0.06, 1.0)
    way = np.where(time // 0.8 % 2 > 0, -1.0, 1.0)
    position = -2.5e-5 * way * np.cos(np.pi * moved)
    meter = SampleMeter(20, reading=UNKNOWN)
    record = columns(2 * milliseconds(len(time)), position, np.gradient(position, time), 0.0)
    sticks = [cycle.stick_fraction for cycle in meter.feed(record)]
    assert len(sticks) >= 8
    assert sticks == pytest.approx([0.925] * len(sticks), abs=0.01)


@pytest.mark.parametrize(
    ("high", "low", "rate"), [(0.0, 0.5, 800.0), (0.1, 0.4, 200.0), (0.8, 0.0, 200.0)]
)
def test_rests_on_a_guide_at_rest_are_whole_wherever_noise_ends_a_cycle(
    high: float, low: float, rate: float
) -> None:
    """It rests for these shares of each second at its highest and its lowest position."""
    time = np.arange(0.0, 9.0, 1.0 / rate)
    move = (1.0 - high - low) / 2.0
    turns = np.array([0.0, low, low + move, 1.0 - move, 1.0])
    course = np.interp(time % 1.0, turns, [0.0, 0.0, 1.0, 1.0, 0.0])
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(time))
    position = 0.5 - np.cos(np.pi * course) / 2.0 + noise
    meter = WindowMeter(20)
    cycles = meter.feed(time, position, np.gradient(position, time), 0.0 * time)
    assert len(cycles) >= 6
    sticks = [cycle.stick_fraction for cycle in cycles]
    assert np.mean(sticks) == pytest.approx(high + low, abs=0.04)


def test_cycles_that_do_not_tell_their_stick_make_the_mean_less_sure() -> None:
    def means(sticks: list[float]) -> Measures:
        cycles = [Cycle(1e-3, 1e-2, 0.0, 0.1, 10.0, stick) for stick in sticks]
        return CycleMeans.over(cycles).measures(False, True, None)

    told = [0.2, 0.3, 0.4, 0.5, 0.6]
    known, partly = means(told), means([*told, *[np.nan] * 4])
    assert known.errors is not None
    assert partly.errors is not None
    assert partly.stick_fraction == pytest.approx(known.stick_fraction)
    assert partly.errors["stick_fraction"] > 1.5 * known.errors["stick_fraction"]
    hidden = means([*told, *[np.nan] * 6])
    assert hidden.regime is hidden.stick_fraction is None
    assert hidden.errors is not None
    assert "stick_fraction" not in hidden.errors
    few = means([0.2, 0.2, np.nan, np.nan])
    assert few.errors is not None
    assert "stick_fraction" not in few.errors
