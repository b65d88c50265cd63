"""How the charts of the page look; what they show comes with each frame."""

from typing import Any

from stickslip_ros.plots.style import BLUE, GREEN, GREY, ORANGE

_LINE: dict[str, Any] = {"type": "line", "showSymbol": False, "silent": True}
_AXIS: dict[str, Any] = {
    "type": "value",
    "scale": True,
    "axisLine": {"onZero": False},
    "nameTextStyle": {"align": "left"},
    "axisLabel": {"showMinLabel": False, "showMaxLabel": False},
}
_CENTRED: dict[str, Any] = {"nameLocation": "middle", "nameGap": 28}


def _line(colour: str, style: str = "solid", **more: Any) -> dict[str, Any]:
    return _LINE | {"lineStyle": {"color": colour, "width": 1.3, "type": style}} | more


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
        _AXIS | _CENTRED | {"gridIndex": 2, "name": "time before now (s)"},
    ],
    "yAxis": [_AXIS | {"gridIndex": index} for index in range(3)],
    "series": [
        _line(BLUE, xAxisIndex=0, yAxisIndex=0),
        _line(BLUE, xAxisIndex=1, yAxisIndex=1),
        _line(GREY, "dashed", xAxisIndex=1, yAxisIndex=1),
        _line(ORANGE, xAxisIndex=2, yAxisIndex=2, step="end"),
    ],
}
"""Displacement, velocity with the belt's, and control force over time."""

PORTRAIT: dict[str, Any] = {
    "animation": False,
    "legend": {"top": 0, "data": ["equilibrium", "slide"]},
    "grid": {"left": 70, "right": 20, "top": 60, "bottom": 45},
    "xAxis": _AXIS | _CENTRED,
    "yAxis": _AXIS,
    "series": [
        _line(
            BLUE,
            markLine={
                "lineStyle": {"color": GREY, "type": "dashed"},
                "label": {"formatter": "belt", "position": "insideEndTop"},
                "data": [],
            },
        ),
        {
            "type": "scatter",
            "name": "equilibrium",
            "symbol": "diamond",
            "symbolSize": 14,
            "itemStyle": {"color": GREEN},
            "silent": True,
        },
        {
            "type": "scatter",
            "name": "slide",
            "symbolSize": 8,
            "itemStyle": {"color": "black"},
            "silent": True,
        },
    ],
}
"""Velocity over displacement, with belt speed, equilibrium and where the slide is."""

CYCLES: dict[str, Any] = {
    "animation": False,
    "legend": {"top": 0},
    "grid": {"left": 70, "right": 60, "top": 60, "bottom": 45},
    "xAxis": {"type": "value", "scale": True, "minInterval": 1, "name": "cycle", **_CENTRED},
    "yAxis": [
        _AXIS | {"min": 0},
        {
            "type": "value",
            "name": "stick fraction",
            "position": "right",
            "axisLine": {"onZero": False},
            "nameTextStyle": {"align": "right"},
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
