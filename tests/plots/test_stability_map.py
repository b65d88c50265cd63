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
from stickslip_ros.plots.stability_map import design_figure, stability_figure
from stickslip_ros.plots.style import STYLES, save
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.design import Design, Task, design
from tests.physics.drives import FEED_DRIVE, PAPER
from tests.plots.texts import faults

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


def test_axes_have_symbols_and_units() -> None:
    figure = stability_figure(map_of(), None, title="a loop")
    axes, bar = figure.axes
    assert axes.get_xlabel() == "cutoff frequency $d$ (rad/s)"
    assert axes.get_ylabel() == "linear gain $k_1$ (N s/m)"
    assert bar.get_ylabel() == "decay rate (1/s)"
    values = "belt speed 40 mm/s, sample rate 1 kHz, force delay 2.5 ms"
    assert figure.get_suptitle() == f"a loop\n{values}"


def test_the_colour_bar_has_round_numbers() -> None:
    _, bar = stability_figure(map_of(), None).axes
    ticks = bar.get_yticks()
    step = ticks[1] - ticks[0]
    assert ticks[0] == 0.0
    assert np.allclose(ticks, step * np.arange(len(ticks)))
    assert f"{step:.0e}"[0] in "125"
    assert ticks[-1] >= map_of().decay_rates.max()


def test_each_side_of_the_limit_is_named_where_it_is() -> None:
    found = map_of()
    axes, _ = stability_figure(found, None).axes
    names = {text.get_text(): text.get_position() for text in axes.texts}
    assert names.keys() == {"stable", "unstable"}
    for name, (corner_frequency, gain) in names.items():
        rate = found.loop.decay_rate(WashoutGains(corner_frequency, gain, 0.0))
        assert (rate > 0.0) == (name == "stable")


def designed(force_limit: float) -> Design:
    limit = f"washout_controller.force_limit={force_limit}"
    return design(Task.from_scenario(load_scenario("feed_drive", [limit]), (0.04, 0.04)))


def test_a_design_shows_the_force_limit_as_a_contour() -> None:
    found = designed(200.0)
    around, controller = found.map_around(), found.controller
    assert around is not None
    assert controller is not None
    forces = found.peak_forces(around)
    row, column = 40, int(np.abs(around.linear_gains - controller.linear_gain).argmin())
    assert around.corner_frequencies[row] == pytest.approx(controller.corner_frequency)
    (check,) = found.checks
    assert forces[row, column] == pytest.approx(check.peak_force, rel=0.1)
    assert forces[row, column] < 200.0 < forces.max()
    figure = design_figure(found)
    (legend,) = figure.legends
    names = {text.get_text() for text in legend.get_texts()}
    assert {"force limit 200 N", "needs a larger force"} <= names
    assert "Designed gains, feed_drive, washout control" in figure.get_suptitle()


def test_a_design_without_a_limit_shows_contours_of_the_force() -> None:
    figure = design_figure(designed(inf))
    (legend,) = figure.legends
    names = {text.get_text() for text in legend.get_texts()}
    assert "largest force at switch-on" in names
    assert "needs a larger force" not in names


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
    figure = stability_figure(found, None)
    axes, bar = figure.axes
    assert axes.get_xlabel() == "cutoff frequency $d$ (dimensionless)"
    assert bar.get_ylabel() == "decay rate (dimensionless)"
    assert figure.get_suptitle() == "belt speed 0.4, sample rate 100"


def test_where_nothing_is_stable_there_is_a_picture_all_the_same(tmp_path: Path) -> None:
    loop = LinearSampledLoop.from_drive(replace(FEED_DRIVE, belt_speed=0.02), 1000.0, 0.015)
    assert loop is not None
    found = StabilityMap.around(loop, replace(GAINS, linear=0.0), points=11)
    assert -inf < found.decay_rates.max() < 0.0
    save(stability_figure(found, None), tmp_path / "map.png")


@pytest.mark.parametrize("style", STYLES)
def test_no_text_is_cut_off_or_overlaps(style: str) -> None:
    look = STYLES[style]
    critical = CriticalGainCurves.over(
        FEED_DRIVE, 20.0, np.array([100.0, 1000.0]), np.linspace(0.0, 0.006, 4)
    )
    title = "Stability of the sampled loop, feed_drive, washout control"
    assert faults(stability_figure(map_of(), critical, title=title, style=look)) == []
    assert faults(stability_figure(map_of(), None, style=replace(look, titled=False))) == []
    assert faults(design_figure(designed(200.0), style=look)) == []
