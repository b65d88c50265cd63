"""The texts of a figure, and whether they can be read."""

from collections.abc import Iterator
from itertools import combinations

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from stickslip_ros.show.style import STYLES

in_styles = pytest.mark.parametrize(
    "style",
    [pytest.param(name, marks=() if name == "paper" else pytest.mark.long) for name in STYLES],
)
"""The narrowest style at once, the others where there is time."""

_TOUCHING = 0.5
"""Overlap of two boxes that is no fault, pixels."""


def faults(figure: Figure) -> list[str]:
    """Return a sentence for each text that is cut off, overlaps another one or exceeds its axis."""
    figure.draw_without_rendering()
    shown = [(text.get_text(), text.get_window_extent()) for text in _texts(figure)]
    whole = figure.bbox
    found = [
        f"{name!r} is cut off"
        for name, box in shown
        if box.x0 < whole.x0 - 1.0
        or box.y0 < whole.y0 - 1.0
        or box.x1 > whole.x1 + 1.0
        or box.y1 > whole.y1 + 1.0
    ]
    for axes in figure.axes:
        room = axes.get_window_extent()
        across, along = axes.xaxis.label, axes.yaxis.label
        if axes.get_visible() and along.get_window_extent().height > room.height + 1.0:
            found.append(f"{along.get_text()!r} is longer than its axis")
        if axes.get_visible() and across.get_window_extent().width > room.width + 1.0:
            found.append(f"{across.get_text()!r} is longer than its axis")
    for (name, box), (other, other_box) in combinations(shown, 2):
        both = Bbox.intersection(box, other_box)
        if both is not None and min(both.width, both.height) > _TOUCHING:
            found.append(f"{name!r} overlaps {other!r}")
    return found


def legend_texts(figure: Figure) -> list[str]:
    """Return the entries of the legends below the panels."""
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def _texts(figure: Figure) -> Iterator[Text]:
    """Yield the texts that are visible, tick labels of the drawn range only."""
    for axes in figure.axes:
        if not axes.get_visible():
            continue
        for axis, (low, high) in (
            (axes.xaxis, sorted(axes.get_xlim())),
            (axes.yaxis, sorted(axes.get_ylim())),
        ):
            for tick in axis.get_major_ticks():
                if low <= tick.get_loc() <= high and tick.label1.get_visible():
                    yield from _written(tick.label1)
            yield from _written(axis.label)
        for text in (axes.title, *axes.texts):
            yield from _written(text)
    for legend in figure.legends:
        for text in legend.get_texts():
            yield from _written(text)
    for text in figure.texts:
        yield from _written(text)


def _written(text: Text) -> Iterator[Text]:
    if text.get_visible() and text.get_text().strip():
        yield text
