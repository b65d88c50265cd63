"""Common style of the figures: lines, fonts and colours, and how figures are saved."""

from collections.abc import Callable
from functools import wraps
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import matplotlib as mpl
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image

from stickslip_ros.text import printable

BLUE, ORANGE, GREEN, SKY_BLUE, GREY = "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#999999"
"""Colours of Okabe and Ito's palette, which is safe for colour-blind readers, and a grey."""

YELLOW, PURPLE, AMBER = "#F0E442", "#CC79A7", "#E69F00"
"""Three more of that palette."""

LIGHT_GREY = "#CCCCCC"
"""Colour of elements without information."""

DASHES = ("--", ":", "-.")
"""Line styles of markers, in turn, so that colour is not the only distinction."""

MANY = 5000
"""Number of points or cells from which a vector figure contains them as an image."""

_LOOK: dict[str, Any] = {
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 10.0,
    "figure.titlesize": 10.0,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "lines.linewidth": 1.2,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#E5E5E5",
    "grid.linewidth": 0.6,
    "hatch.linewidth": 0.6,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "stickslip_ros",
    "pdf.fonttype": 42,
}

_REPRODUCIBLE = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
"""Metadata to omit by file type, so that the same figure gives the same file."""

DPI = 130.0
"""Dots per inch of a PNG."""

_titles: WeakKeyDictionary[Figure, tuple[str, ...]] = WeakKeyDictionary()
"""The lines above each figure, before they are broken to its width."""

_P = ParamSpec("_P")
_R = TypeVar("_R")


def styled(draw: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate a function so that it draws in the common style, not with the user's settings."""

    @wraps(draw)
    def drawn(*arguments: _P.args, **options: _P.kwargs) -> _R:
        with rc_context():
            _use_style()
            return draw(*arguments, **options)

    return drawn


def set_title(figure: Figure, *lines: str) -> None:
    """Set the title of a figure to `lines`; long lines are wrapped, and cut after three."""
    _titles[figure] = lines
    letters = round(10.0 * float(figure.get_figwidth()))  # ten per inch, on average
    broken = (fill(printable(line), letters, max_lines=3, placeholder=" ...") for line in lines)
    figure.suptitle("\n".join(broken), parse_math=False)


@styled
def adapt(figure: Figure, *, size: tuple[float, float] | None = None, title: bool = True) -> None:
    """Give a figure another size (width and height, inches), or remove the title above it."""
    if size is not None:
        figure.set_size_inches(*size)
    if not title:
        figure.suptitle("")
    elif figure in _titles:
        set_title(figure, *_titles[figure])


def save(
    figure: Figure, path: Path, *, colours: int | None = None, dots_per_inch: float = DPI
) -> None:
    """Write a figure to `path`; the format follows the ending: .png, .svg or .pdf.

    Vector formats keep text as text. A limited number of `colours` makes a PNG, to be kept with the
    sources, a third as large. Raises OSError if the file cannot be written.
    """
    ending = path.suffix.lower()
    with rc_context():
        _use_style()
        if ending == ".png" and colours is not None:
            buffer = BytesIO()
            figure.savefig(buffer, format="png", dpi=110)
            with Image.open(buffer) as image:
                # This method, unlike the usual one, keeps colours that few points have.
                few = image.convert("RGB").quantize(colours, Image.Quantize.MAXCOVERAGE)
            few.save(path, optimize=True)
        else:
            figure.savefig(path, dpi=dots_per_inch, metadata=_REPRODUCIBLE.get(ending))


def _use_style() -> None:
    mpl.rcdefaults()
    settings: Any = mpl.rcParams
    settings.update(_LOOK)
