"""Elements that the parts of the page share, and the options of its charts of the motion.

page.js draws the data of each frame into these.

Text of others is data: it is never parsed as `props`, HTML or a script, which are literals.
"""

import json
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any

from nicegui import ui

from stickslip_ros.show import BLUE, GREEN, GREY, ORANGE, SKY_BLUE

AXIS: dict[str, Any] = {
    "type": "value",
    "scale": True,
    "axisLine": {"onZero": False},
    "nameTextStyle": {"align": "left"},
    "axisLabel": {"showMinLabel": False, "showMaxLabel": False, "hideOverlap": True},
}
CENTRED: dict[str, Any] = {
    "nameLocation": "middle",
    "nameGap": 28,
    "nameTextStyle": {"align": "center"},
}
TOOLBOX: dict[str, Any] = {
    "right": 0,
    "top": 0,
    "itemSize": 13,
    "feature": {
        "dataZoom": {"title": {"zoom": "zoom", "back": "zoom back"}},
        "myPicture": {
            "title": "PNG",
            "icon": "path://M5,23L29,45L55,23M5,44L5,58L54,58L54,44M29,45L29,0",
            ":onclick": "(_, chart) => stickslip.picture(chart)",
        },
    },
}
CURSOR: dict[str, Any] = {"trigger": "axis", "axisPointer": {"type": "cross"}}

LEGEND: dict[str, Any] = {"top": 0, "left": 0, "itemWidth": 16, "itemGap": 7}

STILL: dict[str, Any] = {"animation": False, "backgroundColor": "transparent"}

_LEFT, _RIGHT = 64, 16


@contextmanager
def card(title: str) -> Generator[None]:
    """Add a part of the page with a heading; further elements go into it."""
    with ui.element("section").classes("panel"):
        heading(2, title)
        yield


def heading(level: int, text: str) -> ui.element:
    """Add a heading, as readers of screens know it, and return it."""
    with ui.element(f"h{level}").classes("font-bold") as added:
        ui.label(text)
    return added


def named(element: Any, name: str) -> Any:
    """Give an element a name for readers of screens, and return it."""
    element.props["aria-label"] = name
    return element


def chart(options: dict[str, Any], name: str) -> ui.echart:
    """Add a chart with a name for readers of screens, and return it."""
    return named(ui.echart(options).classes("relative w-full chart").props("role=img"), name)


def table(**headings: str) -> ui.table:
    """Add an empty table with columns by name; the first tells its rows apart."""
    columns = [
        {"name": name, "label": heading, "field": name, "align": "left"}
        for name, heading in headings.items()
    ]
    added = ui.table(columns=columns, rows=[], row_key=columns[0]["name"])
    return added.classes("w-full").props("wrap-cells flat dense hide-bottom")


def show_commands(commands: Sequence[str]) -> None:
    """Add commands for a terminal."""
    with ui.row().classes("w-full no-wrap items-start commands"):
        ui.label("\n".join(commands)).classes("grow")
        copy = ui.button(icon="content_copy").props("flat round size=sm")
        copy.on("click", js_handler="(event) => stickslip.copy(event)")
        named(copy, "copy")


def call(function: str, *arguments: Any) -> None:
    """Run a function of page.js on the page; its arguments are data."""
    ui.run_javascript(f"stickslip.{function}({', '.join(map(json.dumps, arguments))})")


def line(name: str, colour: str, style: str = "solid") -> dict[str, Any]:
    """Return a series that is drawn as a line."""
    look = {"color": colour, "width": 1.3, "type": style}
    series: dict[str, Any] = {"type": "line", "name": name, "symbol": "none", "data": []}
    return series | {"lineStyle": look, "itemStyle": {"color": colour}}


def points(name: str, colour: str, size: float, symbol: str = "circle") -> dict[str, Any]:
    """Return a series that is drawn as points."""
    look: dict[str, Any] = {"symbol": symbol, "symbolSize": size, "itemStyle": {"color": colour}}
    return {"type": "scatter", "name": name, "data": []} | look


def _axes(grid: int) -> dict[str, int]:
    return {"xAxisIndex": grid, "yAxisIndex": grid}


TRACE: dict[str, Any] = {
    **STILL,
    "legend": LEGEND,
    "grid": [
        {"left": _LEFT, "right": _RIGHT, "top": top, "height": "20%"}
        for top in ("15%", "43%", "71%")
    ],
    "xAxis": [
        AXIS | {"gridIndex": 0, "axisLabel": {"show": False}},
        AXIS | {"gridIndex": 1, "axisLabel": {"show": False}},
        AXIS | CENTRED | {"gridIndex": 2},
    ],
    "yAxis": [AXIS | {"gridIndex": index} for index in range(3)],
    "series": [
        line("slide", BLUE) | _axes(0),
        line("slide", BLUE) | _axes(1),
        line("belt", GREY, "dashed") | _axes(1),
        line("control force", ORANGE) | {"step": "end"} | _axes(2),
        line("held, no new force", ORANGE, "dotted") | _axes(2),
        points("sent, not applied", ORANGE, 3) | _axes(2),
        line("A", GREEN, "dotted"),
        line("B", SKY_BLUE, "dotted"),
    ],
}
"""Displacement, velocity of slide and belt, and control force over time."""

PORTRAIT: dict[str, Any] = {
    **STILL,
    "legend": LEGEND | {"data": ["slide", "equilibrium"]},
    "grid": {"left": _LEFT, "right": _RIGHT, "top": 56, "bottom": 45},
    "xAxis": AXIS | CENTRED,
    "yAxis": AXIS,
    "series": [
        points("equilibrium", GREEN, 14, "diamond") | {"silent": True},
        line("slide", BLUE)
        | {
            "markLine": {
                "symbol": "none",
                "silent": True,
                **STILL,
                "lineStyle": {"color": GREY, "type": "dashed"},
                "label": {"formatter": "belt", "position": "insideEndTop"},
                "data": [],
            }
        },
    ],
}
"""Phase portrait: velocity over displacement, with belt speed and equilibrium."""

CYCLES: dict[str, Any] = {
    **STILL,
    "legend": LEGEND,
    "toolbox": TOOLBOX,
    "tooltip": CURSOR,
    "grid": {"left": _LEFT, "right": 56, "top": 56, "bottom": 45},
    "xAxis": AXIS | CENTRED | {"minInterval": 1, "name": "cycle"},
    "yAxis": [
        AXIS | {"min": 0},
        {
            "type": "value",
            "name": "stick fraction",
            "position": "right",
            "axisLine": {"onZero": False},
            **CENTRED,
            "nameGap": 36,
            "min": 0,
            "max": 1,
        },
    ],
    "series": [
        line("amplitude", BLUE),
        line("stick fraction", ORANGE, "dashed") | {"yAxisIndex": 1},
    ],
}
"""Amplitude and stick fraction of the last cycles."""
