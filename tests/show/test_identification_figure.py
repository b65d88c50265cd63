"""The figure of an identification."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks import identification as study
from stickslip_ros.identification.identify import identify
from stickslip_ros.show.identification_figure import identification_figure
from tests.identification.axis_record import record


def _axes(figure: Figure) -> dict[str, Axes]:
    """Return the axes by their title, or else the label of their vertical axis."""
    return {each.get_title() or each.get_ylabel().split()[0]: each for each in figure.axes}


def test_a_band_that_is_huge_does_not_hide_the_curve() -> None:
    found = identify([record("coulomb", 2.5)], "coulomb", {"force_delay": 0.0})
    curves = found.curves
    vague = [
        replace(each, standard_error=np.where(each.speed > 0.0, 1e6, np.inf)) for each in curves
    ]
    vars(found)["curves"] = vague
    figure = identification_figure(found)
    axes = _axes(figure)
    largest = max(float(each.force.max()) for each in curves)
    assert axes["friction"].get_ylim()[1] < 1.3 * largest
    entries = [text.get_text() for text in axes["friction"].get_legend().get_texts()]
    assert entries == [
        *("forward slip, measured", "fitted", "95 % band"),
        *("backward slip, measured", "fitted", "95 % band"),
    ]
    assert axes["residuals over time"].get_ylabel().startswith("force, measured less fitted (")
    figure.draw_without_rendering()


def test_the_residuals_of_a_drive_on_a_spring_are_those_of_its_position() -> None:
    own = study.record("stribeck", "stick", 1, 2.0)
    found = identify([own], "stribeck", {"mass": study.MASS})
    axes = _axes(identification_figure(found))
    label = axes["residuals over time"].get_ylabel().replace("\n", " ")
    assert label == "position, measured less fitted (nm)"
    error = found.check(own)["segment_error"]
    assert np.sqrt(np.mean(found.residuals(found.records[0]).error ** 2)) == error
    assert "difference" in axes
    motion = axes["in-sample: measured, and without feedback (dashed)"]
    assert motion.get_legend() is None
    assert len(motion.lines) == 2
