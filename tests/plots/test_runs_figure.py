"""The figure of several runs."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.bags.report import report_of_bag
from stickslip_ros.physics.measures.cycle_measures import measures_of
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.plots.run_history import RunHistory
from stickslip_ros.plots.runs_figure import DrawnRun, runs_figure
from stickslip_ros.plots.style import STYLES
from tests.physics.drives import FEED_DRIVE, PAPER
from tests.plots.texts import faults, in_styles, legend_texts

# Old versions of matplotlib call names that its parser of formulas has deprecated since.
# What other tests left open is collected at any time.
pytestmark = pytest.mark.filterwarnings(
    "error", "ignore::DeprecationWarning", "ignore::ResourceWarning"
)

REFERENCE = Path(__file__).parents[2] / "bags" / "reference"


@cache
def drawn(name: str, end: float, drive: Drive = FEED_DRIVE) -> DrawnRun:
    history = RunHistory()
    report = report_of_bag(REFERENCE, end=end, observer=history)
    return DrawnRun(name, history, measures_of(report), drive)


@in_styles
def test_each_run_has_a_column_and_a_line_in_each_common_panel(style: str) -> None:
    # The units are SI, since not all drives are without units.
    runs = [drawn("long", 2.0), drawn("short", 1.0), drawn("shortest", 0.02, PAPER)]
    figure = runs_figure(runs, style=STYLES[style])
    assert faults(figure) == []
    assert legend_texts(figure) == ["long", "short", "shortest"]
    upper, (portrait, amplitude, stick_fraction) = figure.axes[:6], figure.axes[6:]
    shown = [axes for axes in upper if axes.get_title()]
    assert [axes.get_title().split("\n")[0] for axes in shown] == ["long", "short", "shortest"]
    assert len({axes.get_xlim() for axes in upper}) == 1
    assert len({axes.get_ylim() for axes in shown}) == 1
    colours = {axes.lines[0].get_color() for axes in shown}
    assert len(colours) == 3
    for axes in (portrait, amplitude, stick_fraction):
        assert {line.get_color() for line in axes.lines} == colours
    for number, run in enumerate(runs):
        drawn_amplitude = np.asarray(amplitude.lines[number].get_ydata(), dtype=float)
        assert drawn_amplitude == pytest.approx(1e6 * run.history.cycles[1])
    assert amplitude.get_ylabel().replace("\n", " ") == "amplitude (µm)"


def test_there_are_no_units_where_all_drives_have_none() -> None:
    figure = runs_figure([drawn("a", 1.0, PAPER)] * 2)
    assert figure.axes[0].get_ylabel() == "displacement $X$"
