"""The map of decay rates and its plot."""

from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.theory.closed_forms import CubicLoop
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.physics.theory.stability_map import CriticalGainCurves, StabilityMap
from stickslip_ros.plots.stability_map import stability_figure
from stickslip_ros.plots.style import save
from tests.physics.drives import FEED_DRIVE, PAPER

GAINS = WashoutGains(20.0, -3000.0, 0.0)


def map_of(force_delay: float = 0.0025, gains: WashoutGains = GAINS) -> StabilityMap:
    loop = LinearSampledLoop.from_drive(FEED_DRIVE, 1000.0, force_delay)
    assert loop is not None
    return StabilityMap.around(loop, gains, points=21)


def test_the_map_is_around_the_gains() -> None:
    found = map_of()
    assert found.corner_frequencies[[0, -1]] == pytest.approx([2.0, 200.0])
    assert found.linear_gains[[0, -1]] == pytest.approx([-6000.0, 1500.0])
    assert found.decay_rates.shape == (21, 21)
    row, column = 10, 8
    assert found.corner_frequencies[row] == pytest.approx(20.0)
    assert found.linear_gains[column] == pytest.approx(-3000.0)
    rate = found.loop.decay_rate(GAINS)
    assert found.decay_rates[row, column] == pytest.approx(rate)


def test_decay_rates_change_sign_at_the_critical_gain() -> None:
    found = map_of()
    for row, corner_frequency in enumerate(found.corner_frequencies):
        (interval,) = found.loop.stable_linear_gains(float(corner_frequency))
        inside = (found.linear_gains > interval.low) & (found.linear_gains < interval.high)
        assert np.array_equal(found.decay_rates[row] > 0.0, inside)


def test_the_continuous_loop_has_its_closed_form() -> None:
    found = map_of()
    cubic = CubicLoop.from_drive(PAPER)
    assert cubic is not None
    expected = [cubic.critical_linear_gain(d / 100.0) for d in found.corner_frequencies.tolist()]
    assert found.continuous == pytest.approx(1e4 * np.array(expected), rel=1e-9)


def test_without_gains_it_is_around_the_critical_one() -> None:
    found = map_of(gains=WashoutGains(20.0, 0.0, 0.0))
    critical = found.loop.critical_linear_gain(20.0)
    assert critical is not None
    assert found.linear_gains[0] == pytest.approx(2.0 * critical)


def test_critical_gains_over_rate_and_delay() -> None:
    rates, delays = np.array([100.0, 1000.0]), np.array([0.0, 0.005, 0.015])
    found = CriticalGainCurves.over(FEED_DRIVE, 20.0, rates, delays)
    for row, rate in enumerate(rates):
        for column, delay in enumerate(delays):
            loop = LinearSampledLoop.from_drive(FEED_DRIVE, rate, delay)
            assert loop is not None
            critical = loop.critical_linear_gain(20.0)
            assert found.linear_gains[row, column] == pytest.approx(critical or np.nan, nan_ok=True)
    assert np.isnan(found.linear_gains[:, 2]).all()


@pytest.mark.parametrize(("ending", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml")])
@pytest.mark.parametrize("with_critical_gains", [False, True])
def test_the_format_follows_the_ending(
    tmp_path: Path, ending: str, start: bytes, with_critical_gains: bool
) -> None:
    path = tmp_path / f"map{ending}"
    critical = None
    if with_critical_gains:
        delays = np.linspace(0.0, 0.06, 7)
        critical = CriticalGainCurves.over(FEED_DRIVE, 20.0, np.array([100.0, 1000.0]), delays)
    save(stability_figure(map_of(), critical), path)
    assert path.read_bytes().startswith(start)


def test_axes_have_units(tmp_path: Path) -> None:
    path = tmp_path / "map.svg"
    save(stability_figure(map_of(), None), path)
    picture = path.read_text(encoding="utf-8")
    for label in ("cutoff frequency d (rad/s)", "linear gain k1 (N s/m)", "decay rate (1/s)"):
        assert label in picture
    assert "belt speed 40 mm/s, sample rate 1 kHz, force delay 2.5 ms" in picture


def test_curves_are_told_apart_without_colour() -> None:
    rates, delays = np.array([100.0, 300.0, 1000.0]), np.linspace(0.0, 0.006, 4)
    critical = CriticalGainCurves.over(FEED_DRIVE, 20.0, rates, delays)
    _, axes, _ = stability_figure(map_of(), critical).axes
    assert axes.get_xlabel() == "force delay (ms)"
    curves = axes.lines[:3]
    assert [curve.get_label() for curve in curves] == ["100 Hz", "300 Hz", "1 kHz"]
    assert len({curve.get_linestyle() for curve in curves}) == 3
    assert curves[0].get_xdata().max() == pytest.approx(6.0)


def test_for_the_unit_drive_it_is_dimensionless() -> None:
    loop = LinearSampledLoop.from_drive(PAPER, 100.0, 0.0)
    assert loop is not None
    found = StabilityMap.around(loop, WashoutGains(2.0, -1.0, -1.0), points=11)
    axes, bar = stability_figure(found, None).axes
    assert axes.get_xlabel() == "cutoff frequency d (dimensionless)"
    assert bar.get_ylabel() == "decay rate (dimensionless)"
    assert axes.get_title() == "belt speed 0.4, sample rate 100"


def test_where_nothing_is_stable_there_is_a_picture_all_the_same(tmp_path: Path) -> None:
    loop = LinearSampledLoop.from_drive(replace(FEED_DRIVE, belt_speed=0.02), 1000.0, 0.015)
    assert loop is not None
    found = StabilityMap.around(loop, replace(GAINS, linear=0.0), points=11)
    assert -inf < found.decay_rates.max() < 0.0
    save(stability_figure(found, None), tmp_path / "map.png")
