"""The bifurcation diagram of the theory as a figure."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

from stickslip_ros.physics.model.friction import Exponential
from stickslip_ros.physics.theory.bifurcation_branches import BifurcationBranches
from stickslip_ros.plots.branches_figure import branches_figure
from stickslip_ros.plots.style import STYLES
from tests.physics.drives import FEED_DRIVE, PAPER
from tests.plots.texts import faults, in_styles, legend_texts


@pytest.fixture(scope="module")
def supercritical() -> BifurcationBranches:
    return BifurcationBranches.around(FEED_DRIVE, points=6)


@pytest.fixture(scope="module")
def subcritical() -> BifurcationBranches:
    drive = replace(PAPER, friction=Exponential(0.4, 0.25, 0.1, 0.0))
    return BifurcationBranches.around(drive, points=12)


def check_regions(figure: Figure, names: list[str]) -> None:
    """Check that the names of the regions stand beside each other, above the curves."""
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.texts] == names
    top = max(np.nanmax(np.asarray(line.get_ydata(), dtype=float)) for line in axes.lines[:8])
    highest = axes.transData.transform((0.0, top))[1]
    boxes = [text.get_window_extent() for text in axes.texts]
    for box in boxes:
        assert box.y0 > highest
        assert axes.bbox.x0 < box.x0 < box.x1 < axes.bbox.x1
    for one, other in pairwise(boxes):
        assert one.x1 < other.x0


@in_styles
def test_a_supercritical_diagram(supercritical: BifurcationBranches, style: str) -> None:
    figure = branches_figure(supercritical, title="Bifurcation diagram", style=STYLES[style])
    assert faults(figure) == []
    assert figure.get_suptitle() == "Bifurcation diagram"
    assert legend_texts(figure) == [
        "equilibrium, unstable", "equilibrium, stable", "stick-slip, stable", "pure slip, stable",
        "Hopf point 48.88 mm/s", "onset of sticking 43.95 mm/s", "belt speed of the drive 40 mm/s",
    ]  # fmt: skip
    (axes,) = figure.axes
    assert axes.get_xlabel() == "belt speed $v$ (mm/s)"
    assert axes.get_ylabel() == "displacement $x$ (µm)"
    check_regions(figure, ["stick-slip", "pure slip", "rest"])
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
        "pure slip, unstable", "stick-slip, stable", "fold, onset of sticking 1.504"
    } <= set(names)  # fmt: skip
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.texts] == ["stick-slip", "stick-slip or rest", "rest"]
    (legend,) = figure.legends
    for line, name in zip(legend.get_lines(), names, strict=True):
        if "stable" in name:
            assert line.is_dashed() == ("unstable" in name)


def test_a_drive_at_rest_has_no_mark_of_its_own() -> None:
    found = BifurcationBranches.over(replace(PAPER, belt_speed=0.0), np.linspace(0.5, 0.6, 3))
    assert legend_texts(branches_figure(found, title="")) == ["equilibrium, stable"]
