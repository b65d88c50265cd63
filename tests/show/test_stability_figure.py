"""The map of decay rates and its figure, and the bifurcation diagram of the theory."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import inf

import numpy as np
import pytest

from stickslip_ros.model.control import Washout
from stickslip_ros.model.friction import Exponential
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.show.stability_figure import branches_figure, design_figure, stability_figure
from stickslip_ros.show.style import STYLES
from stickslip_ros.studies.design import Design, Task, design
from stickslip_ros.theory.bifurcation_branches import BifurcationBranches
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.theory.stability_map import CriticalGainCurves, StabilityMap
from tests.drives import FEED_DRIVE, PAPER
from tests.show.texts import faults, in_styles, legend_texts
from tests.theory.closed_forms import CubicLoop

GAINS = Washout(20.0, -3000.0, 0.0)


def map_of(force_delay: float = 0.0025, gains: Washout = GAINS) -> StabilityMap:
    loop = LinearSampledLoop.from_drive(FEED_DRIVE, 1000.0, force_delay)
    return StabilityMap.around(loop, gains, points=21)


def test_the_continuous_loop_has_its_closed_form() -> None:
    found = map_of()
    cubic = CubicLoop.from_drive(PAPER)
    expected = [cubic.critical_linear_gain(d / 100.0) for d in found.corner_frequencies.tolist()]
    assert found.continuous == pytest.approx(1e4 * np.array(expected), rel=1e-9)


def test_critical_gains_over_rate_and_delay() -> None:
    rates, delays = np.array([100.0, 1000.0]), np.array([0.0, 0.005, 0.015])
    found = CriticalGainCurves.over(FEED_DRIVE, 20.0, rates, delays)
    for row, rate in enumerate(rates):
        for column, delay in enumerate(delays):
            loop = LinearSampledLoop.from_drive(FEED_DRIVE, rate, delay)
            critical = loop.critical_linear_gain(20.0)
            assert found.linear_gains[row, column] == pytest.approx(critical or np.nan, nan_ok=True)
    assert np.isnan(found.linear_gains[:, 2]).all()


@cache
def critical_gains() -> CriticalGainCurves:
    rates, delays = np.array([100.0, 300.0, 1000.0]), np.linspace(0.0, 0.006, 4)
    return CriticalGainCurves.over(FEED_DRIVE, 20.0, rates, delays)


@in_styles
def test_the_map_of_a_loop_and_its_critical_gains(style: str) -> None:
    found = map_of(force_delay=0.003)
    title = "Stability of the sampled loop, feed_drive, washout control"
    figure = stability_figure(found, critical_gains(), title=title, style=STYLES[style])
    assert faults(figure) == []
    axes, curves, bar = figure.axes
    assert axes.get_xlabel() == "cutoff frequency $d$ (rad/s)"
    assert axes.get_ylabel() == "linear gain $k_1$ (N s/m)"
    assert bar.get_ylabel() == "decay rate (1/s)"
    shown = figure.get_suptitle().replace("\n", " ")
    assert shown == f"{title} belt speed 40 mm/s, sample rate 1 kHz, force delay 3 ms"
    # Each side of the limit is named where it is.
    names = {text.get_text(): text.get_position() for text in axes.texts}
    assert names.keys() == {"stable", "unstable"}
    for name, (corner_frequency, gain) in names.items():
        rate = found.loop.decay_rate(Washout(corner_frequency, gain, 0.0))
        assert (rate > 0.0) == (name == "stable")
    # The colour bar has round numbers.
    ticks = bar.get_yticks()
    step = ticks[1] - ticks[0]
    assert ticks[0] == 0.0
    assert np.allclose(ticks, step * np.arange(len(ticks)))
    assert f"{step:.0e}"[0] in "125"
    assert ticks[-1] >= found.decay_rates.max()
    # The curves differ in more than colour.
    assert curves.get_xlabel() == "force delay (ms)"
    *others, own = curves.lines[:3]
    assert [line.get_label() for line in (*others, own)] == ["100 Hz", "300 Hz", "1 kHz, this loop"]
    assert len({line.get_linestyle() for line in (*others, own)}) == 3
    assert np.max(own.get_xdata()) == pytest.approx(6.0)
    assert own.get_linewidth() > max(line.get_linewidth() for line in others)
    (region,) = curves.collections
    assert region.get_label() == "stable, this loop"
    (path,) = region.get_paths()
    for gain in (GAINS.linear_gain, -1000.0, 1000.0):
        stable = found.loop.decay_rate(replace(GAINS, linear_gain=gain)) > 0.0
        assert path.contains_point((3.0, gain)) == stable


@pytest.fixture(scope="module")
def designed() -> Design:
    limit = "washout_controller.force_limit=200"
    return design(Task.from_scenario(load_scenario("feed_drive", [limit]), (0.04, 0.04)))


@in_styles
def test_a_design_shows_the_force_limit_as_a_contour(designed: Design, style: str) -> None:
    figure = design_figure(designed, style=STYLES[style])
    assert faults(figure) == []
    assert {"force limit 200 N", "needs a larger force"} <= set(legend_texts(figure))
    assert "Designed gains, feed_drive, washout control" in figure.get_suptitle()


def test_the_force_at_the_proposal_is_that_of_its_check(designed: Design) -> None:
    around, controller = designed.map_around(), designed.controller
    forces = designed.peak_forces(around)
    row, column = 40, int(np.abs(around.linear_gains - controller.linear_gain).argmin())
    assert around.corner_frequencies[row] == pytest.approx(controller.corner_frequency)
    check, *_ = designed.checks
    assert forces[row, column] == pytest.approx(check.peak_force, rel=0.1)
    assert forces[row, column] < 200.0 < forces.max()


def test_a_design_without_a_limit_shows_contours_of_the_force(designed: Design) -> None:
    unlimited = replace(designed, task=replace(designed.task, force_limit=inf))
    names = legend_texts(design_figure(unlimited))
    assert "largest force at switch-on" in names
    assert "needs a larger force" not in names


def test_where_nothing_is_stable_there_is_a_figure_all_the_same() -> None:
    loop = LinearSampledLoop.from_drive(replace(FEED_DRIVE, belt_speed=0.02), 1000.0, 0.015)
    found = StabilityMap.around(loop, replace(GAINS, linear_gain=0.0), points=11)
    assert -inf < found.decay_rates.max() < 0.0
    figure = stability_figure(found, None, style=replace(STYLES["paper"], titled=False))
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.texts] == ["unstable"]
    assert faults(figure) == []


@pytest.fixture(scope="module")
def supercritical() -> BifurcationBranches:
    return BifurcationBranches.around(FEED_DRIVE, points=6)


@pytest.fixture(scope="module")
def subcritical() -> BifurcationBranches:
    drive = replace(PAPER, friction=Exponential(0.4, 0.25, 0.1, 0.0))
    return BifurcationBranches.around(drive, points=8)


@in_styles
def test_a_supercritical_diagram(supercritical: BifurcationBranches, style: str) -> None:
    figure = branches_figure(supercritical, title="Bifurcation diagram", style=STYLES[style])
    assert faults(figure) == []
    assert figure.get_suptitle() == "Bifurcation diagram"
    assert legend_texts(figure) == [
        "equilibrium, unstable", "equilibrium, stable", "stick-slip, stable", "pure slip, stable",
        "critical feed speed (Hopf) 48.88 mm/s", "stick-slip onset speed 43.95 mm/s",
        "belt speed of the drive 40 mm/s",
    ]  # fmt: skip
    (axes,) = figure.axes
    assert axes.get_xlabel() == "belt speed $v$ (mm/s)"
    assert axes.get_ylabel() == "displacement $x$ (µm)"
    # The names of the regions stand beside each other, above the curves.
    assert [text.get_text() for text in axes.texts] == ["stick-slip", "pure slip", "steady sliding"]
    top = max(np.nanmax(np.asarray(line.get_ydata(), dtype=float)) for line in axes.lines[:8])
    highest = axes.transData.transform((0.0, top))[1]
    boxes = [text.get_window_extent() for text in axes.texts]
    for box in boxes:
        assert box.y0 > highest
        assert axes.bbox.x0 < box.x0 < box.x1 < axes.bbox.x1
    for one, other in pairwise(boxes):
        assert one.x1 < other.x0
    # A cycle has two lines, which meet at the Hopf point.
    (branch,) = supercritical.cycles
    for edge in (branch.least, branch.greatest):
        drawn = [
            np.asarray(line.get_ydata(), dtype=float)
            for line in axes.lines
            if len(np.asarray(line.get_ydata())) == len(edge)
        ]
        covered = [np.isclose(1e-6 * values, edge, rtol=1e-12) for values in drawn]
        assert np.logical_or.reduce(covered).all()


@in_styles
def test_of_a_subcritical_diagram_the_unstable_is_dashed(
    subcritical: BifurcationBranches, style: str
) -> None:
    figure = branches_figure(subcritical, title="Bifurcation diagram", style=STYLES[style])
    assert faults(figure) == []
    names = legend_texts(figure)
    assert {
        "pure slip, unstable", "stick-slip, stable", "fold, stick-slip onset speed 1.504"
    } <= set(names)  # fmt: skip
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.texts] == [
        "stick-slip",
        "stick-slip or steady sliding",
        "steady sliding",
    ]
    (legend,) = figure.legends
    for line, name in zip(legend.get_lines(), names, strict=True):
        if "stable" in name:
            assert line.is_dashed() == ("unstable" in name)


def test_a_drive_at_rest_has_no_mark_of_its_own() -> None:
    found = BifurcationBranches.over(replace(PAPER, belt_speed=0.0), np.linspace(0.5, 0.6, 3))
    assert legend_texts(branches_figure(found, title="")) == ["equilibrium, stable"]
