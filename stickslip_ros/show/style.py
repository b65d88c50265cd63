"""Common style of the figures: lines, fonts and sizes, and how figures are saved."""

import os
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial, wraps
from io import BytesIO
from itertools import accumulate
from logging import ERROR, getLogger
from pathlib import Path
from textwrap import fill
from typing import Any, ParamSpec, TypeVar, cast

import matplotlib as mpl
import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.cbook import is_math_text
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath
from matplotlib.ticker import AutoLocator

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import written
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.text import printable, shown

DASHES = ("--", ":", "-.")
"""Line styles of markers, in turn, so that colour is not the only distinction."""

MANY = 5000
"""Number of points or cells from which a vector figure contains them as an image."""


_LOOK, _PRINTED = (
    mpl.rc_params_from_file(
        Path(__file__).with_name(f"{name}.mplstyle"), use_default_template=False
    )
    for name in ("screen", "print")
)
"""Settings of every figure, and those that differ in print."""

_UNBROKEN = "\u00a0"

_MILLIMETRE = 1.0 / 25.4

_PAGE_HEIGHT = 235.0 * _MILLIMETRE
"""Largest height of a figure in print, inches: a page of a journal."""

_REPRODUCIBLE = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Metadata to omit by file type, so that the same figure gives the same file."""
_DATE = "SOURCE_DATE_EPOCH"


@dataclass(frozen=True)
class FigureStyle:
    """Size, resolution and layout of a figure, for a screen or for print."""

    dots_per_inch: float = 130.0
    """Dots per inch of a PNG."""
    width: float | None = None
    """Width of a column in print, inches; None: each figure has its own."""
    narrow: bool = False
    """Whether the panels are above each other, because two do not fit side by side."""
    size: tuple[float, float] | None = None
    """Width and height that were asked for, inches; None: that of the style."""
    titled: bool = True
    """Whether there is a title above the figure."""

    @property
    def printed(self) -> bool:
        """Whether the figure is for print."""
        return self.width is not None

    def figure(
        self, width: float, height: float, *, wide: float | None = None, narrow: float | None = None
    ) -> Figure:
        """Return an empty figure; `width` and `height` (inches) are those on a screen.

        In print the height keeps the ratio to the width, unless the ratio of a `wide` figure, of
        two columns, or of a `narrow` one is given.
        """
        if self.size is not None:
            return Figure(figsize=self.size)
        if self.width is None:
            return Figure(figsize=(width, height))
        ratio = (narrow if self.narrow else wide) or height / width
        return Figure(figsize=(self.width, min(ratio * self.width, _PAGE_HEIGHT)))

    def crowded(self, width: float, height: float) -> bool:
        """Return whether a figure that has this size on a screen, inches, must do with less."""
        if self.size is None:
            return self.printed
        return self.size[0] < 0.8 * width or self.size[1] < 0.8 * height

    def set_title(self, figure: Figure, *lines: str) -> None:
        """Set the title of a figure to `lines`; long lines are wrapped, and cut after three."""
        if not self.titled:
            return
        text = wrapped(lines, float(figure.get_figwidth()), mpl.rcParams["figure.titlesize"])
        figure.suptitle(text, parse_math=False)

    def legend_below(self, figure: Figure, handles: Sequence[Artist], most: int = 12) -> None:
        """Set a legend below the panels, in as many columns as fit, at most so many."""
        columns = _legend_columns(handles, 0.95 * float(figure.get_figwidth()), most)
        figure.legend(handles=list(handles), loc="outside lower center", ncols=columns)


SCREEN = FigureStyle()
"""For the screen."""

STYLES = {
    "screen": SCREEN,
    "paper": FigureStyle(300.0, 85.0 * _MILLIMETRE, narrow=True),
    "paper-double": FigureStyle(300.0, 180.0 * _MILLIMETRE),
}
"""Styles by name: for the screen, and for one column or two of a journal."""


def style_named(name: str) -> FigureStyle:
    """Return a style by its name; raises InvalidInputError for an unknown one."""
    if name not in STYLES:
        raise InvalidInputError(
            f"style = {shown(name)} is invalid: must be one of {', '.join(STYLES)}"
        )
    return STYLES[name]


_P = ParamSpec("_P")
_R = TypeVar("_R")


def styled(draw: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate a function so that it draws in its `style`, not with the user's settings.

    The style is an argument by keyword; without it the function draws for the screen.
    """

    @wraps(draw)
    def drawn(*arguments: _P.args, **options: _P.kwargs) -> _R:
        with rc_context():
            _use_style(cast(FigureStyle, options.get("style", SCREEN)))
            return draw(*arguments, **options)

    return drawn


def title_of(what: str, scenario: Scenario, varied: Collection[str] = ()) -> str:
    """Return the title of what is shown of a scenario, such as a bifurcation diagram.

    It contains the overrides of the scenario, except of the parameters that are `varied`.
    """
    known = (*varied, "plant.expects_control")
    fixed = [text for text in scenario.overrides if text.partition("=")[0] not in known]
    law = scenario.control_law
    control = "no control" if law is None else f"{law.name} control"
    return ", ".join([what, " ".join([scenario.name, *fixed]), control])


def finish(figure: Figure) -> None:
    """Make ticks round, labels and titles no longer than their axes, once all is drawn.

    The ticks of linear axes are whole multiples of 1, 2 or 5 times a power of ten. A label that is
    longer than its axis is broken into two lines.
    """
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            locator = axis.get_major_locator()
            if isinstance(locator, AutoLocator):
                locator.set_params(steps=[1.0, 2.0, 5.0, 10.0])
    figure.draw_without_rendering()
    for axes in figure.axes:
        room = axes.get_window_extent()
        along = axes.yaxis.label
        for across in (axes.xaxis.label, axes.title):
            if across.get_window_extent().width > room.width:
                across.set_text(_in_two_lines(across.get_text()))
        if along.get_window_extent().height > room.height:
            along.set_text(_in_two_lines(along.get_text()))


def _in_two_lines(text: str) -> str:
    """Return a text with the break that makes the longer line as short as possible."""
    words = text.split(" ")
    breaks = [(" ".join(words[:count]), " ".join(words[count:])) for count in range(1, len(words))]
    return "\n".join(min(breaks, key=lambda pair: max(map(len, pair)), default=(text,)))


def wrapped(lines: Iterable[str], width: float, size: float | str) -> str:
    """Return lines in a font of that size, wrapped to a width (inches) and cut after three."""
    letters = round(115.0 * width / FontProperties(size=size).get_size_in_points())
    # A number stays with its unit.
    joined = (re.sub(r"(?<=\d) (?=\D{1,4}(?:[ ,;]|$))", _UNBROKEN, printable(x)) for x in lines)
    wrap = partial(fill, max_lines=3, placeholder=" ...", break_on_hyphens=False)
    return "\n".join(wrap(line, letters) for line in joined).replace(_UNBROKEN, " ")


def text_width(text: str, points: float) -> float:
    """Return the width of a line of text in a font of that size, inches."""
    extent = TextToPath().get_text_width_height_descent(
        text, FontProperties(size=points), ismath=bool(is_math_text(text))
    )
    return float(extent[0]) / 72.0


def _legend_columns(handles: Sequence[Artist], room: float, most: int) -> int:
    """Return the largest number of columns with which a legend is no wider than `room`, inches."""
    settings: Any = mpl.rcParams
    points = float(settings["legend.fontsize"])
    widths = [text_width(str(handle.get_label()), points) for handle in handles]
    handle = (settings["legend.handlelength"] + settings["legend.handletextpad"]) * points / 72.0
    between = settings["legend.columnspacing"] * points / 72.0
    for columns in range(min(most, len(handles)), 1, -1):
        sizes = [len(part) for part in np.array_split(np.arange(len(widths)), columns)]
        ends = list(accumulate(sizes))
        widest = [max(widths[end - size : end]) for size, end in zip(sizes, ends, strict=True)]
        if sum(widest) + columns * handle + (columns - 1) * between <= room:
            return columns
    return 1


def save(figure: Figure, path: Path, *, dots_per_inch: float = SCREEN.dots_per_inch) -> None:
    """Write a figure to `path`; the format follows the ending: .png, .svg or .pdf.

    Vector formats keep text as text. Raises OSError if the file cannot be written.
    """
    drawn = rendered(figure, path.suffix[1:].lower(), dots_per_inch)
    with written(path, replace=True) as stream:
        stream.buffer.write(drawn)


def rendered(
    figure: Figure,
    kind: str,
    dots_per_inch: float = SCREEN.dots_per_inch,
    *,
    outlines: bool = False,
) -> bytes:
    """Return a figure as a file of this kind: png, svg or pdf; its texts as `outlines` if asked."""
    drawn = BytesIO()
    with rc_context():
        _use_style(SCREEN)
        if outlines:
            mpl.rcParams["svg.fonttype"] = "path"
        getLogger("fontTools").setLevel(ERROR)  # of the fonts of matplotlib it tells their dates
        # matplotlib fails at a wrong date of the environment, also where it writes none.
        date = os.environ.pop(_DATE, None)
        try:
            figure.savefig(drawn, format=kind, dpi=dots_per_inch, metadata=_REPRODUCIBLE.get(kind))
        finally:
            if date is not None:
                os.environ[_DATE] = date
    return drawn.getvalue()


def _use_style(style: FigureStyle) -> None:
    mpl.rcdefaults()
    settings: Any = mpl.rcParams
    settings.update(_LOOK)
    if style.printed:
        settings.update(_PRINTED)
