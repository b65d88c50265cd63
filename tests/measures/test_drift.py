"""Drift: runs that look steady from cycle to cycle and would not be later."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip_ros.measures import Measures, Regime
from stickslip_ros.measures.cycle_measures import Cycle, Trend, trend_text
from stickslip_ros.measures.drift import Drift, TrendMeter
from stickslip_ros.measures.run_meter import RunMeter
from stickslip_ros.measures.run_report import report_of
from stickslip_ros.model.control import Pid
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.simulation import simulate_sampled
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.simulate import sensor_meter
from tests.measures.records import columns, milliseconds

COUNT = 4000
TIME = np.arange(COUNT) * 1e-3


# An integral of the position that never ends.
WINDS_UP = Pid(position_gain=0.0, integral_gain=4e5, velocity_gain=3000.0)


def wound_up(duration: float, *overrides: str) -> tuple[Measures, Measures | None]:
    """Return the measures of the motion under that law, and of what a sensor tells of it."""
    scenario = load_scenario("feed_drive", list(overrides))
    motion = RecordedMotion(scenario.plant.as_drive(), 0.0, 0.0)
    loop, told = scenario.plant.as_loop(motion), sensor_meter(scenario)
    controller = Controller(WINDS_UP)
    meter = scenario.cycle_meter(20)
    true = simulate_sampled(loop, motion, controller, duration, meter, measured=told)
    return true, None if told is None else told.measures()


ENCODER = ("plant.sensor.position_resolution=1e-6", "plant.sensor.velocity=difference")


@pytest.mark.parametrize("sensor", [(), ENCODER], ids=["exact", "encoder"])
def test_a_loop_whose_integral_winds_up_is_not_at_rest(sensor: tuple[str, ...]) -> None:
    differences = ("plant.sensor.difference_samples=8",) if sensor else ()
    for measures in wound_up(3.0, *sensor, *differences):
        if measures is None:
            continue
        assert measures.regime is Regime.EQUILIBRIUM
        assert measures.steady is False
        assert measures.trend is Trend.DRIFTING
        # The spring follows the force.
        assert measures.drift["position"] == pytest.approx(measures.drift["force"] / 1e6, rel=0.1)
        assert "drifting, position -" in trend_text(vars(measures))


def samples(position: np.ndarray, belt: float = 0.04) -> SampleColumns:
    return columns(milliseconds(COUNT), position, np.gradient(position, 1e-3), belt)


@pytest.mark.parametrize(("rate", "drifts"), [(0.0, False), (0.3, False), (2.0, True)])
def test_a_force_that_grows_is_a_drift_even_if_the_slide_does_not_move(
    rate: float, drifts: bool
) -> None:
    """By 0.3 % of 400 N during the run nothing is said; by 2 % it is."""
    meter = RunMeter(20)
    meter.motion.feed(samples(np.full(COUNT, 4e-4), belt=0.0))
    noise = np.random.default_rng(0).standard_normal(COUNT)
    forces = ForceColumns(milliseconds(COUNT), 400.0 + rate * TIME + 0.1 * noise)
    meter.feed_forces(forces, forces[:0])
    report = report_of(meter)
    assert report["regime"] == "stuck"
    assert report["steady"] is not drifts
    assert (report["drift"] is not None) is drifts
    if drifts:
        assert report["drift"]["force"] == pytest.approx(rate, rel=0.05)


def test_creep_is_a_drift() -> None:
    meter = RunMeter(20)
    meter.motion.feed(samples(4e-5 * (1.0 - np.exp(-TIME / 30.0))))
    report = report_of(meter)
    assert report["steady"] is False
    assert report["trend"] == "drifting"


def rates(sizes: np.ndarray, middles: np.ndarray, step: float) -> dict[str, float]:
    """Return the drift of cycles of 64 ms, seen by an encoder with steps."""
    drift, ends = Drift(), (np.arange(len(sizes)) * 0.064).tolist()
    drift.resolution = step
    measured = zip(sizes.tolist(), middles.tolist(), strict=True)
    drift.feed_cycles(ends, [Cycle(size, 1e-3, mid, 0.064, 15.6, 0.0) for size, mid in measured])
    return drift.rates(0.064)


@pytest.mark.parametrize(("change", "drifts"), [(0.5e-6, False), (3e-6, True)])
def test_a_drift_of_cycles_within_a_step_of_the_encoder_does_not_matter(
    change: float, drifts: bool
) -> None:
    """The midpoint moves by a quarter of a step, or by one and a half."""
    middles = 1e-5 + change * np.linspace(0.0, 1.0, 60)
    assert ("position" in rates(np.full(60, 4e-6), middles, 2e-6)) is drifts


def test_eight_cycles_that_agree_within_half_a_step_by_chance_are_no_drift() -> None:
    sizes = 4.4e-4 - 5.8e-6 * 0.064 * np.maximum(np.arange(28) - 20, 0)
    middles = np.full(28, 1e-5)
    assert rates(sizes, middles, 5e-6) == {}
    assert rates(sizes, middles, 1e-6).keys() == {"amplitude"}


def test_a_belt_that_varies_makes_no_drift_but_a_note() -> None:
    meter = RunMeter(20)
    position = 4e-4 * (1.0 + 0.1 * TIME)
    meter.motion.feed(columns(milliseconds(COUNT), position, belt_velocity=0.04 + 0.01 * TIME))
    report = report_of(meter)
    assert report["drift"] is None
    assert any("a drift is not judged" in note for note in report["notes"])


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(0, COUNT), max_size=8).map(sorted))
def test_blocks_of_any_length_give_the_same_trend(starts: list[int]) -> None:
    value = 1.0 + 0.1 * TIME + 0.01 * np.sin(100.0 * TIME)
    whole, meter = TrendMeter(), TrendMeter()
    whole.feed(TIME, value)
    for start, end in zip([0, *starts], [*starts, COUNT], strict=True):
        meter.feed(TIME[start:end], value[start:end])
    assert whole.rate() == meter.rate()
    assert whole.rate() == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize("period", [0.0635, 0.0639, 0.0645])
def test_a_force_whose_parts_are_nearly_whole_cycles_has_no_trend(period: float) -> None:
    """Parts of 64 ms: plain means of them have a beat of seconds."""
    meter, time = TrendMeter(), np.arange(12_000) * 1e-3
    angle = 2.0 * np.pi * time / period
    force = 100.0 * np.sin(angle + 1.0) + 30.0 * np.sin(2.0 * angle)
    meter.feed(time, force)
    assert meter.rate(4.0 * period) is None
    drifting = TrendMeter()
    drifting.feed(time, force + 20.0 * time / time[-1])
    assert drifting.rate(4.0 * period) == pytest.approx(20.0 / time[-1], rel=0.3)
