"""The figure of several runs."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from stickslip_ros.bags.report import report_of_bag
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.plots.run_history import RunHistory
from stickslip_ros.plots.runs_figure import DrawnRun, runs_figure
from stickslip_ros.plots.style import STYLES, save
from tests.physics.drives import FEED_DRIVE, PAPER
from tests.plots.texts import faults

# Old versions of matplotlib call names that its parser of formulas has deprecated since.
pytestmark = pytest.mark.filterwarnings("error", "ignore::DeprecationWarning")

REFERENCE = Path(__file__).parents[2] / "bags" / "reference"


def drawn(name: str, end: float, drive: object = FEED_DRIVE) -> DrawnRun:
    history = RunHistory()
    report = report_of_bag(REFERENCE, end=end, observer=history)
    measures = Measures(**{field: report[field] for field in Measures.__dataclass_fields__})
    return DrawnRun(name, history, measures, drive)


def labels(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_each_run_has_a_column_and_a_line_in_each_common_panel(tmp_path: Path) -> None:
    runs = [drawn("long", 2.0), drawn("short", 1.0), drawn("shortest", 0.02)]
    figure = runs_figure(runs)
    save(figure, tmp_path / "runs.png")
    upper, (portrait, amplitude, stick_fraction) = figure.axes[:6], figure.axes[6:]
    assert [axes.get_title().split("\n")[0] for axes in upper[:3]] == ["long", "short", "shortest"]
    assert len({axes.get_xlim() for axes in upper}) == 1
    assert len({axes.get_ylim() for axes in upper[:3]}) == 1
    assert labels(figure) == ["long", "short", "shortest"]
    colours = {axes.lines[0].get_color() for axes in upper[:3]}
    assert len(colours) == 3
    for axes in (portrait, amplitude, stick_fraction):
        assert {line.get_color() for line in axes.lines} == colours
    for number, run in enumerate(runs):
        drawn_amplitude = np.asarray(amplitude.lines[number].get_ydata(), dtype=float)
        assert drawn_amplitude == pytest.approx(1e6 * run.history.cycles[1])
    assert amplitude.get_ylabel() == "amplitude (µm)"


def test_without_units_only_where_all_drives_have_none() -> None:
    assert runs_figure([drawn("a", 1.0, PAPER)] * 2).axes[0].get_ylabel() == ("displacement $X$")
    mixed = runs_figure([drawn("a", 1.0, PAPER), drawn("b", 1.0)])
    assert mixed.axes[0].get_ylabel() == "displacement $x$ (µm)"


@pytest.mark.parametrize("style", STYLES)
def test_no_text_is_cut_off_or_overlaps(style: str) -> None:
    runs = [drawn("long", 2.0), drawn("short", 1.0)]
    assert faults(runs_figure(runs, style=STYLES[style])) == []
