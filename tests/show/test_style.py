"""How figures look, what their titles say, and how they are written to files."""

import os
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.show.style import SCREEN, STYLES, FigureStyle, save, styled, title_of


@styled
def small_figure(label: str = "displacement (µm)") -> Figure:
    figure = Figure(figsize=(3.0, 2.0))
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.0, 2.0])
    axes.set_xlabel(label)
    return figure


@pytest.mark.parametrize("ending", [".PNG", ".svg", ".pdf"])
def test_the_suffix_gives_the_format_and_the_same_figure_the_same_file(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever date the environment gives."""
    path, again = tmp_path / f"one{ending}", tmp_path / f"other{ending.lower()}"
    save(small_figure(), path)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "x")
    save(small_figure(), again)
    assert path.read_bytes() == again.read_bytes()
    assert os.environ["SOURCE_DATE_EPOCH"] == "x"
    match ending.lower():
        case ".png":
            with Image.open(path) as image:
                assert (image.format, image.size) == ("PNG", (390, 260))
        case ".svg":
            texts = [text.text for text in ElementTree.parse(path).iter() if text.text]
            assert "displacement (µm)" in texts
        case _:
            assert path.read_bytes().startswith(b"%PDF")


def test_a_users_own_settings_neither_matter_nor_change(tmp_path: Path) -> None:
    save(small_figure(), tmp_path / "one.svg")
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red", "svg.fonttype": "path"}):
        save(small_figure(), tmp_path / "other.svg")
        assert mpl.rcParams["font.size"] == 30.0
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "other.svg").read_bytes()


def test_a_title_is_shown_as_it_is_within_the_figure() -> None:
    figure = Figure(figsize=(8.0, 2.0))
    SCREEN.set_title(figure, "a $name$ with \x1b[31m" + " and more" * 40, "a second line")
    title, *more = figure.get_suptitle().split("\n")
    assert title.startswith("a $name$ with ")
    assert "\x1b" not in title
    assert more[-2].endswith(" ...")
    assert more[-1] == "a second line"
    figure.draw_without_rendering()
    box = next(text for text in figure.texts).get_window_extent()
    assert 0.0 < box.x0 < box.x1 < figure.bbox.x1


def test_a_number_in_a_title_stays_with_its_unit() -> None:
    figure = Figure(figsize=(2.0, 2.0))
    SCREEN.set_title(figure, "frequency 1234567890.15 Hz")  # of which 23 letters fit
    assert figure.get_suptitle() == "frequency\n1234567890.15 Hz"


@styled
def labelled_figure(*, style: FigureStyle = SCREEN) -> Figure:
    figure = style.figure(8.0, 4.0, narrow=1.5)
    style.set_title(
        figure, "a title that is longer than one column of a journal is wide, on purpose"
    )
    (axes,) = figure.subplots(1, 1, squeeze=False)[0]
    axes.set_xlabel("displacement $x$ (mm)")
    labels = ["short", "a label of some length", "another label of some length", "$k_1$", "last"]
    handles = [Line2D([], [], label=label) for label in labels]
    style.legend_below(figure, handles, most=5)
    return figure


@pytest.mark.parametrize(
    ("name", "width", "height", "points"),
    [("screen", 8.0, 4.0, 9.0), ("paper", 3.346, 5.02, 8.0), ("paper-double", 7.087, 3.543, 8.0)],
)
def test_a_style_gives_size_and_font(name: str, width: float, height: float, points: float) -> None:
    figure = labelled_figure(style=STYLES[name])
    assert figure.get_size_inches() == pytest.approx([width, height], rel=1e-3)
    assert figure.axes[0].xaxis.label.get_size() == points
    figure.draw_without_rendering()
    for artist in (*figure.texts, *figure.legends):
        box = artist.get_window_extent()
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1


def test_a_size_that_is_asked_for_beats_that_of_the_style_and_a_title_may_be_left_out() -> None:
    figure = labelled_figure(style=replace(STYLES["paper"], size=(6.0, 5.0), titled=False))
    assert figure.get_suptitle() == ""
    assert figure.get_size_inches().tolist() == [6.0, 5.0]
    assert figure.axes[0].xaxis.label.get_size() == 8.0


def test_a_title_names_what_is_shown_the_drive_and_the_control() -> None:
    free = "plant.expects_control=false"
    damping = "plant.damping=3.0"
    for overrides, drive, control in (
        ([], "feed_drive", "washout control"),
        ([damping], f"feed_drive {damping}", "washout control"),
        (["plant.damping=4.0", free, damping], f"feed_drive {damping}", "no control"),
    ):
        scenario = load_scenario("feed_drive", overrides)
        assert title_of("Simulated run", scenario) == f"Simulated run, {drive}, {control}"
