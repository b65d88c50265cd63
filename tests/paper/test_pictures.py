"""The plots of the paper's figures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from stickslip_ros.paper.figures import Panel, PortraitFigure, compute_figure
from stickslip_ros.paper.pictures import draw_paper_figure
from stickslip_ros.paper.portraits import PortraitCase, portraits
from stickslip_ros.paper.transition_marks import unstable_equilibria
from stickslip_ros.physics.model.friction import Linear
from stickslip_ros.plots.style import BLUE, GREEN, ORANGE, STYLES
from tests.physics.drives import PAPER

STICKS = PortraitCase("it sticks", replace(PAPER, belt_speed=0.2), duration=100.0)
RESTS = PortraitCase("it rests", replace(PAPER, belt_speed=0.7), duration=200.0)
RUNS_AWAY = PortraitCase("it runs", replace(PAPER, belt_speed=0.2, friction=Linear(0.4, 0.9)))
TOO_SHORT = PortraitCase("it ends", PAPER, duration=3.0)


def figure_of(*panels: list[PortraitCase]) -> PortraitFigure:
    drawn = tuple(Panel("panel", tuple(portraits(cases))) for cases in panels)
    return PortraitFigure(99, "a title", drawn)


@pytest.fixture(scope="module")
def small_figure() -> PortraitFigure:
    return figure_of([STICKS, RESTS], [RUNS_AWAY, STICKS], [RUNS_AWAY], [TOO_SHORT])


def channels(colour: str) -> npt.NDArray[np.int64]:
    return np.array([int(colour[start : start + 2], 16) for start in (1, 3, 5)])


def colours(path: Path) -> npt.NDArray[np.int64]:
    with Image.open(path) as image:
        found = image.convert("RGB").getcolors(1 << 24)
    return np.array([colour for _, colour in found])


@pytest.mark.parametrize(("ending", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml")])
def test_the_format_follows_the_ending(
    tmp_path: Path, small_figure: PortraitFigure, ending: str, start: bytes
) -> None:
    path = tmp_path / f"figure{ending}"
    draw_paper_figure(path, small_figure)
    assert path.read_bytes().startswith(start)


def test_portraits_say_what_they_show(tmp_path: Path, small_figure: PortraitFigure) -> None:
    path = tmp_path / "figure.svg"
    draw_paper_figure(path, small_figure)
    picture = path.read_text(encoding="utf-8")
    for text in ("a title", "it sticks", "sticks 28.6%, amplitude 0.319", "equilibrium"):
        assert text in picture
    for text in (r"unbounded: 10 $v_0$ at $\tau$ = 8.", "no whole cycle", "belt speed", "$X'$"):
        assert text in picture


def test_only_what_sticks_has_sticking_in_its_legend(tmp_path: Path) -> None:
    path = tmp_path / "figure.svg"
    draw_paper_figure(path, figure_of([RESTS]))
    assert "sticking" not in path.read_text(encoding="utf-8")


def test_a_picture_keeps_its_colours_and_is_small(
    tmp_path: Path, small_figure: PortraitFigure
) -> None:
    path = tmp_path / "figure.png"
    draw_paper_figure(path, small_figure)
    found = colours(path)
    for colour in (BLUE, ORANGE, GREEN, "#000000", "#FFFFFF"):
        assert np.abs(found - channels(colour)).max(axis=1).min() <= 8
    assert path.stat().st_size < 100_000


def test_a_bifurcation_diagram_names_regimes_and_marks(tmp_path: Path) -> None:
    path = tmp_path / "figure.svg"
    figure = compute_figure(2, points=11)
    marks = {"Hopf point": 0.48876, "limit of sticking": 0.4396}
    draw_paper_figure(path, figure, marks, unstable_equilibria(figure))
    picture = path.read_text(encoding="utf-8")
    for text in ("belt speed $v_0$", "turning points $X$", "stick-slip", "unstable equilibrium"):
        assert text in picture
    for text in ("stuck", "Hopf point 0.48876", "limit of sticking 0.4396"):
        assert text in picture
    assert "unbounded" not in picture


def test_the_title_of_every_diagram_fits(tmp_path: Path) -> None:
    for number in (2, 3, 4, 5):
        path = tmp_path / f"figure_{number}.png"
        draw_paper_figure(path, compute_figure(number, points=3))
        with Image.open(path) as image:
            edges = np.asarray(image.convert("L"))[:40][:, [0, -1]]
        assert edges.min() > 250


@pytest.mark.parametrize(("style", "millimetres"), [("paper", 85.0), ("paper-double", 180.0)])
def test_a_figure_for_print_is_as_wide_as_its_columns(
    tmp_path: Path, small_figure: PortraitFigure, style: str, millimetres: float
) -> None:
    for number, figure in enumerate((small_figure, compute_figure(3, points=3))):
        path = tmp_path / f"{number}.png"
        draw_paper_figure(path, figure, style=STYLES[style])
        with Image.open(path) as image:
            assert image.width == pytest.approx(300.0 * millimetres / 25.4, abs=1.0)
            edges = np.asarray(image.convert("L"))[:, [0, -1]]
        assert edges.min() > 250
