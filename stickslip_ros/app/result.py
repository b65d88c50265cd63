"""What commands do with a result: they print it, as tables or as JSON, draw it, and make a page."""

import argparse
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import add_json, check_writable, whole, writing
from stickslip_ros.app.optional_dependencies import load_matplotlib
from stickslip_ros.app.output import print_parts
from stickslip_ros.errors import InvalidInputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.api.results import Result
    from stickslip_ros.show.style import FigureStyle

_FIGURE_FILES = (".png", ".svg", ".pdf")
_PAGE_FILES = (".html", ".htm")

_LEAST_INCHES, _MOST_INCHES = 2, 50
"""Width and height of a figure, inches."""
_MOST_PIXELS = 2e8
_STYLES = "screen", "paper", "paper-double"
"""The names of `show.style.STYLES`; importing that takes long."""


def add_plot(parser: argparse.ArgumentParser, shown: str) -> None:
    """Add --plot, which draws what is `shown`, and what the figure is to look like."""
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="FILE",
        help=f"draw {shown} ({', '.join(_FIGURE_FILES)}); an existing file is replaced",
    )
    parser.add_argument(
        "--size",
        type=_size,
        metavar="WxH",
        help="width and height of the figure, inches, as in --size 6x4",
    )
    parser.add_argument(
        "--style",
        choices=_STYLES,
        help="what a figure is for: a screen, or a column (85 mm) or two (180 mm) of a journal, "
        "with fonts of 8 points (default: screen)",
    )
    parser.add_argument(
        "--dpi",
        type=whole("a whole number of dots per inch from {} to {}", 20, 600),
        metavar="N",
        help="dots per inch of the figure (default: 130, in the styles for paper 300)",
    )
    parser.add_argument("--no-title", action="store_true", help="omit the title of the figure")


def add_results(parser: argparse.ArgumentParser, shown: str) -> None:
    """Add the forms of a result: --plot as in `add_plot`, --html, which writes a page, --json."""
    add_plot(parser, shown)
    parser.add_argument(
        "--html",
        type=Path,
        metavar="FILE",
        help="write a report as one page, to read offline, print and hand on: verdict, feeds that "
        "hold, gains, force and figure, on one sheet of A4; then what the command prints, "
        "parameters and versions; an existing file is replaced",
    )
    add_json(parser)


def check_results(arguments: argparse.Namespace) -> None:
    """Refuse a figure or a page that cannot be written, before anything is computed."""
    page: Path | None = getattr(arguments, "html", None)
    if page is not None:
        if page.suffix.lower() not in _PAGE_FILES:
            raise InvalidInputError(f"--html {page}: must end in one of {', '.join(_PAGE_FILES)}")
        check_writable("--html", page)
        load_matplotlib()
    path: Path | None = arguments.plot
    size: tuple[float, float] | None = arguments.size
    dpi: int | None = arguments.dpi
    given = {
        "--size": size is not None and f"{size[0]:g}x{size[1]:g}",
        "--dpi": dpi,
        "--style": arguments.style,
        "--no-title": arguments.no_title and "",
    }
    shown = [
        f"{name} {value}".rstrip() for name, value in given.items() if value not in (None, False)
    ]
    if path is None:
        if shown:
            raise InvalidInputError(f"{' '.join(shown)}: needs --plot FILE, which is not given")
        return
    if path.suffix.lower() not in _FIGURE_FILES:
        raise InvalidInputError(f"--plot {path}: must end in one of {', '.join(_FIGURE_FILES)}")
    if size is not None and dpi is not None and size[0] * size[1] * dpi**2 > _MOST_PIXELS:
        raise InvalidInputError(
            f"{' '.join(shown[:2])}: would be {size[0] * size[1] * dpi**2:.3g} pixels, and must be "
            f"at most {_MOST_PIXELS:g}"
        )
    check_writable("--plot", path)
    load_matplotlib()


def is_drawn(arguments: argparse.Namespace) -> bool:
    """Return whether there will be a figure, in a file of its own or on a page."""
    return arguments.plot is not None or getattr(arguments, "html", None) is not None


def write_results(arguments: argparse.Namespace, result: "Result", **options: Any) -> None:
    """Write what --plot and --html ask for; `options` are those of the result's `plot`."""
    if arguments.plot is not None:
        _write_figure(arguments, partial(result.draw, **options))
    if getattr(arguments, "html", None) is not None:
        with writing("--html", arguments.html):
            result.to_html(arguments.html, **options)


def print_result(arguments: argparse.Namespace, result: "Result") -> None:
    """Print a result: its tables and sentences, or with --json one object."""
    if arguments.json:
        result.write_json(sys.stdout)
    else:
        print_parts(*result.parts())


def give_result(arguments: argparse.Namespace, result: "Result") -> None:
    """Print a result that took long, then write what --plot and --html ask for: it may fail."""
    print_result(arguments, result)
    write_results(arguments, result)


def _write_figure(arguments: argparse.Namespace, draw: "Callable[[FigureStyle], Figure]") -> None:
    """Draw a figure as it is asked for, and write it to the file that --plot names."""
    from stickslip_ros.show.style import STYLES, save

    style = replace(
        STYLES[arguments.style or "screen"], size=arguments.size, titled=not arguments.no_title
    )
    figure = draw(style)
    with writing("--plot", arguments.plot), warnings.catch_warnings():
        warnings.filterwarnings("error", "constrained_layout not applied", UserWarning)
        try:
            save(figure, arguments.plot, dots_per_inch=arguments.dpi or style.dots_per_inch)
        except UserWarning:
            width, height = figure.get_size_inches()
            raise InvalidInputError(
                f"--size {width:g}x{height:g}: is too small for this figure"
            ) from None


def _size(text: str) -> tuple[float, float]:
    """Parse WIDTHxHEIGHT, inches."""
    parts = text.lower().split("x")
    try:
        width, height = (float(part) for part in parts)
    except ValueError:
        width = height = float("nan")
    if not (_LEAST_INCHES <= width <= _MOST_INCHES and _LEAST_INCHES <= height <= _MOST_INCHES):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not WIDTHxHEIGHT in inches, each from {_LEAST_INCHES} to {_MOST_INCHES}, "
            "such as 6x4"
        )
    return width, height
