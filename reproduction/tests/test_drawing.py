"""The drawings of the paper's figures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from reproduction.drawing import paper_figure, save_paper_figure, typeset
from reproduction.figures import (
    Panel,
    PortraitCase,
    PortraitFigure,
    Portraits,
    compute_figure,
    portrait_of,
)
from reproduction.tests.test_figures import over_belt_speed
from stickslip_ros.model.friction import Linear
from stickslip_ros.show import BLUE, GREEN, ORANGE
from stickslip_ros.show.style import STYLES
from tests.drives import PAPER
from tests.show.texts import faults, in_styles, legend_texts

STICKS = PortraitCase("it sticks", replace(PAPER, belt_speed=0.2), duration=100.0)
RESTS = PortraitCase("it rests", replace(PAPER, belt_speed=0.7), duration=200.0)
RUNS_AWAY = PortraitCase("it runs", replace(PAPER, belt_speed=0.2, friction=Linear(0.4, 0.9)))
TOO_SHORT = PortraitCase("it ends", PAPER, duration=3.0)

WIDTHS = {"screen": None, "paper": 85.0 / 25.4, "paper-double": 180.0 / 25.4}


def figure_of(*panels: list[PortraitCase]) -> PortraitFigure:
    drawn = tuple(Panel("panel", Portraits(map(portrait_of, cases))) for cases in panels)
    return PortraitFigure(99, "a title", drawn)


@pytest.fixture(scope="module")
def small_figure() -> PortraitFigure:
    return figure_of([STICKS, RESTS], [RUNS_AWAY, STICKS], [RUNS_AWAY], [TOO_SHORT])


def channels(colour: str) -> npt.NDArray[np.int64]:
    return np.array([int(colour[start : start + 2], 16) for start in (1, 3, 5)])


@in_styles
def test_portraits_say_what_they_show(
    tmp_path: Path, small_figure: PortraitFigure, style: str
) -> None:
    figure = paper_figure(small_figure, style=STYLES[style])
    assert faults(figure) == []
    assert figure.get_suptitle() == "a title"
    assert legend_texts(figure) == [
        "first 20 periods", "later", "last 5 cycles", "sticking", "belt speed", "equilibrium"
    ]  # fmt: skip
    titles = " ".join(axes.get_title().replace("\n", " ") for axes in figure.axes)
    for text in ("it sticks sticks 28.6%,", " 0.319", r"unbounded: 10 $v_0$ at $\tau$ = 8."):
        assert text in titles
    assert "it ends no whole cycle" in titles
    assert {axes.get_ylabel() for axes in figure.axes} == {"$X'$", ""}
    path = tmp_path / "figure.png"
    save_paper_figure(figure, path, STYLES[style])
    width = WIDTHS[style]
    with Image.open(path) as image:
        if width is not None:
            assert image.width == pytest.approx(300.0 * width, abs=1.0)
            return
        found = np.array([colour for _, colour in image.convert("RGB").getcolors(1 << 24) or []])
    # That for the screen keeps its colours and is small.
    for colour in (BLUE, ORANGE, GREEN, "#000000", "#FFFFFF"):
        assert np.abs(found - channels(colour)).max(axis=1).min() <= 8
    assert path.stat().st_size < 100_000


def test_only_what_sticks_has_sticking_in_its_legend() -> None:
    assert "sticking" not in legend_texts(paper_figure(figure_of([RESTS])))


@in_styles
def test_a_bifurcation_diagram_names_regimes_and_marks(style: str) -> None:
    figure = paper_figure(over_belt_speed(), style=STYLES[style])
    assert faults(figure) == []
    above, below = figure.axes
    assert above.get_ylabel() == "turning points $X$"
    assert below.get_xlabel() == "belt speed $v_0$"
    assert legend_texts(figure) == [
        "stick-slip", "steady sliding", "stuck", "unstable equilibrium",
        "Hopf bifurcation 0.48876", "stick-slip onset 0.43947",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "number", [5, *(pytest.param(each, marks=pytest.mark.long) for each in (3, 4))]
)
def test_the_title_of_every_diagram_fits(number: int) -> None:
    assert faults(paper_figure(compute_figure(number, points=3))) == []


def test_symbols_in_plain_text_become_formulas() -> None:
    assert typeset("belt speed v0") == "belt speed $v_0$"
    assert typeset("k1 = -1, d = 2, μs / μm") == r"$k_1$ = -1, $d$ = 2, $\mu_s$ / $\mu_m$"
    assert typeset("X' has 2β, up to τ = 300") == r"$X'$ has 2$\beta$, up to $\tau$ = 300"
    assert typeset("drive and slide") == "drive and slide"
