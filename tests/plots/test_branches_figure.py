"""The bifurcation diagram of the theory as a figure."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

from stickslip_ros.physics.model.friction import Exponential
from stickslip_ros.physics.theory.bifurcation_branches import BifurcationBranches
from stickslip_ros.plots.branches_figure import branches_figure
from stickslip_ros.plots.style import SCREEN, STYLES
from tests.physics.drives import FEED_DRIVE, PAPER
from tests.plots.texts import faults


@pytest.fixture(scope="module")
def supercritical() -> BifurcationBranches:
    return BifurcationBranches.around(FEED_DRIVE, points=12)


@pytest.fixture(scope="module")
def subcritical() -> BifurcationBranches:
    drive = replace(PAPER, friction=Exponential(0.4, 0.25, 0.1, 0.0))
    return BifurcationBranches.around(drive, points=12)


def names(figure: Figure) -> list[str]:
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


def regions(figure: Figure) -> list[str]:
    (axes,) = figure.axes
    return [text.get_text() for text in axes.texts]


def test_branches_and_points_are_named(supercritical: BifurcationBranches) -> None:
    figure = branches_figure(supercritical, title="it")
    assert figure.get_suptitle() == "it"
    assert names(figure) == [
        "equilibrium, unstable", "equilibrium, stable", "stick-slip, stable", "pure slip, stable",
        "Hopf point 48.88 mm/s", "onset of sticking 43.95 mm/s", "belt speed of the drive 40 mm/s",
    ]  # fmt: skip
    (axes,) = figure.axes
    assert axes.get_xlabel() == "belt speed $v$ (mm/s)"
    assert axes.get_ylabel() == "displacement $x$ (µm)"
    assert regions(figure) == ["stick-slip", "pure slip", "rest"]


def test_what_is_unstable_is_dashed(subcritical: BifurcationBranches) -> None:
    figure = branches_figure(subcritical, title="it")
    assert {"pure slip, unstable", "stick-slip, stable", "fold, onset of sticking 1.504"} <= set(
        names(figure)
    )
    assert regions(figure) == ["stick-slip", "stick-slip or rest", "rest"]
    (legend,) = figure.legends
    for line, name in zip(legend.get_lines(), names(figure), strict=True):
        if "stable" in name:
            assert line.is_dashed() == ("unstable" in name)


def test_a_cycle_has_two_lines_that_meet_at_the_hopf_point(
    supercritical: BifurcationBranches,
) -> None:
    (axes,) = branches_figure(supercritical, title="it").axes
    (branch,) = supercritical.cycles
    for edge in (branch.least, branch.greatest):
        drawn = [
            np.asarray(line.get_ydata(), dtype=float)
            for line in axes.lines
            if len(np.asarray(line.get_ydata())) == len(edge)
        ]
        covered = [np.isclose(1e-6 * values, edge, rtol=1e-12) for values in drawn]
        assert np.logical_or.reduce(covered).all()


@pytest.mark.parametrize("style", STYLES)
def test_texts_are_within_the_figure_and_above_the_curves(
    supercritical: BifurcationBranches, style: str
) -> None:
    figure = branches_figure(supercritical, title="it", style=STYLES[style])
    figure.draw_without_rendering()
    (axes,) = figure.axes
    top = max(np.nanmax(np.asarray(line.get_ydata(), dtype=float)) for line in axes.lines[:8])
    highest = axes.transData.transform((0.0, top))[1]
    boxes = [text.get_window_extent() for text in axes.texts]
    assert len(boxes) == 3
    for box in boxes:
        assert box.y0 > highest
        assert axes.bbox.x0 < box.x0 < box.x1 < axes.bbox.x1
    for one, other in pairwise(boxes):
        assert one.x1 < other.x0


def test_a_drive_at_rest_has_no_mark_of_its_own() -> None:
    found = BifurcationBranches.over(replace(PAPER, belt_speed=0.0), np.linspace(0.5, 0.6, 3))
    shown = names(branches_figure(found, title="", style=SCREEN))
    assert shown == ["equilibrium, stable"]


@pytest.mark.parametrize("style", STYLES)
def test_no_text_is_cut_off_or_overlaps(
    supercritical: BifurcationBranches, subcritical: BifurcationBranches, style: str
) -> None:
    for found in (supercritical, subcritical):
        figure = branches_figure(found, title="Bifurcation diagram", style=STYLES[style])
        assert faults(figure) == []
