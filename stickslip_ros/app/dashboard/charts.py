"""Options of the charts of the page; page.js draws the data of each frame into them."""

from typing import Any

from stickslip_ros.plots.style import BLUE, GREEN, GREY, ORANGE

_AXIS: dict[str, Any] = {
    "type": "value",
    "scale": True,
    "axisLine": {"onZero": False},
    "nameTextStyle": {"align": "left"},
    "axisLabel": {"showMinLabel": False, "showMaxLabel": False, "hideOverlap": True},
}
_CENTRED: dict[str, Any] = {
    "nameLocation": "middle",
    "nameGap": 28,
    "nameTextStyle": {"align": "center"},
}


def _line(colour: str, style: str = "solid", **more: Any) -> dict[str, Any]:
    line: dict[str, Any] = {"type": "line", "showSymbol": False, "silent": True}
    return line | {"lineStyle": {"color": colour, "width": 1.3, "type": style}} | more


TRACE: dict[str, Any] = {
    "animation": False,
    "grid": [
        {"left": 70, "right": 20, "top": "8%", "height": "22%"},
        {"left": 70, "right": 20, "top": "39%", "height": "22%"},
        {"left": 70, "right": 20, "top": "70%", "height": "17%"},
    ],
    "xAxis": [
        _AXIS | {"gridIndex": 0, "axisLabel": {"show": False}},
        _AXIS | {"gridIndex": 1, "axisLabel": {"show": False}},
        _AXIS | _CENTRED | {"gridIndex": 2},
    ],
    "yAxis": [_AXIS | {"gridIndex": index} for index in range(3)],
    "series": [{"type": "line", "xAxisIndex": index, "yAxisIndex": index} for index in range(3)],
}
"""Axes for displacement, velocity of slide and belt, and control force over time."""

PORTRAIT: dict[str, Any] = {
    "animation": False,
    "legend": {"top": 0, "data": ["equilibrium"]},
    "grid": {"left": 70, "right": 20, "top": 60, "bottom": 45},
    "xAxis": _AXIS | _CENTRED,
    "yAxis": _AXIS,
    "series": [
        {
            "type": "scatter",
            "name": "equilibrium",
            "symbol": "diamond",
            "symbolSize": 14,
            "itemStyle": {"color": GREEN},
            "silent": True,
        },
        {
            "type": "line",
            "markLine": {
                "symbol": "none",
                "silent": True,
                "animation": False,
                "lineStyle": {"color": GREY, "type": "dashed"},
                "label": {"formatter": "belt", "position": "insideEndTop"},
                "data": [],
            },
        },
    ],
}
"""Phase portrait: velocity over displacement, with belt speed and equilibrium."""

CYCLES: dict[str, Any] = {
    "animation": False,
    "legend": {"top": 0},
    "grid": {"left": 70, "right": 60, "top": 60, "bottom": 45},
    "xAxis": _AXIS | _CENTRED | {"minInterval": 1, "name": "cycle"},
    "yAxis": [
        _AXIS | {"min": 0},
        {
            "type": "value",
            "name": "stick fraction",
            "position": "right",
            "axisLine": {"onZero": False},
            **_CENTRED,
            "nameGap": 36,
            "min": 0,
            "max": 1,
        },
    ],
    "series": [
        _line(BLUE, name="amplitude", itemStyle={"color": BLUE}),
        _line(ORANGE, "dashed", name="stick fraction", yAxisIndex=1, itemStyle={"color": ORANGE}),
    ],
}
"""Amplitude and stick fraction of the last cycles."""
