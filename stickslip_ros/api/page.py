"""The page of a result: one file to read offline, print and hand on."""

from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from stickslip_ros.errors import StickslipError
from stickslip_ros.files import written
from stickslip_ros.installed_packages import versions
from stickslip_ros.tables import TextTable
from stickslip_ros.text import printable

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

    from stickslip_ros.show.style import FigureStyle

_SVG, _XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"

_DOTS_PER_INCH = 200.0
"""Of the parts of a figure that have too many points for lines."""

_STYLES = {"wide": "paper-double", "narrow": "paper"}
"""Style of the figure by the width of the page: of paper or a screen, and of a telephone."""


class Summary(NamedTuple):
    """What a page says of a result beside what the result prints, and its figure."""

    title: str
    """What it is, such as "Simulated run"."""
    subject: str
    """What it is of: the scenario, or the recording."""
    verdict: str
    """The result in one sentence."""
    parameters: Iterable[TextTable] = ()
    """The parameters that it was made with, with their units."""
    facts: Mapping[str, str] = {}
    """What a reader asks first, by name: feeds that hold, gains, force."""


def write_page(
    path: Path,
    summary: Summary,
    parts: Iterable[TextTable | str],
    draw: "Callable[[FigureStyle], Figure]",
) -> None:
    """Write the page of a result to `path`; an existing file is replaced.

    It is one file that asks for no other. In place of a figure that cannot be drawn it says why.
    Raises OSError if the file cannot be written.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    figures: dict[str, Markup] = {}
    reason = ""
    try:
        for name, style in _STYLES.items():
            figures[name] = _drawing(draw, style, name, f"{summary.title}, {summary.subject}")
    except StickslipError as error:
        reason = str(error)
    environment = Environment(
        loader=PackageLoader("stickslip_ros", "api"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.filters["printable"] = printable
    text = environment.get_template("page.html").render(
        **summary._asdict() | {"parameters": [*summary.parameters]},
        results=[part for part in parts if part != summary.verdict],
        figures=figures,
        reason=reason,
        date=f"{datetime.now().astimezone():%Y-%m-%d %H:%M %Z}",
        versions=versions(),
    )
    with written(path, replace=True) as stream:
        stream.write(text)


def _drawing(
    draw: "Callable[[FigureStyle], Figure]", style: str, name: str, label: str
) -> "Markup":
    """Return a figure as SVG, its identifiers being those of no other figure on the page."""
    from dataclasses import replace
    from xml.etree import ElementTree

    from markupsafe import Markup

    from stickslip_ros.show.style import STYLES, rendered

    figure = draw(replace(STYLES[style], titled=False))
    root = ElementTree.fromstring(rendered(figure, "svg", _DOTS_PER_INCH, outlines=True))
    for element in root.iter():
        if element.tag == f"{{{_SVG}}}image":  # equal ones have one, which nothing refers to
            element.attrib.pop("id", None)
        for attribute, value in element.items():
            if attribute == "id":
                element.set(attribute, f"{name}-{value}")
            elif attribute.endswith("href") and value.startswith("#"):
                element.set(attribute, f"#{name}-{value[1:]}")
            else:
                element.set(attribute, value.replace("url(#", f"url(#{name}-"))
    for metadata in root.findall(f"{{{_SVG}}}metadata"):
        root.remove(metadata)
    for size in ("width", "height"):  # the page has it fill its column
        del root.attrib[size]
    root.attrib |= {"role": "img", "aria-label": printable(label)}
    root.attrib["preserveAspectRatio"] = "xMidYMin"  # where paper leaves it less than its width
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _XLINK)
    return Markup(ElementTree.tostring(root, encoding="unicode"))
