"""The part of the page that shows the theory of the running drive: charts, and their options."""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from contourpy import contour_generator
from nicegui import ui

from stickslip_ros.app.dashboard.elements import (
    AXIS,
    CENTRED,
    LEGEND,
    STILL,
    TOOLBOX,
    call,
    card,
    chart,
    line,
    points,
)
from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.app.dashboard.theory import (
    Decay,
    FrictionCurve,
    Theory,
    bifurcation,
    decay,
    friction_curve,
    stability_map,
)
from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, controller_node
from stickslip_ros.show import BLUE, GREEN, GREY, ORANGE, SKY_BLUE
from stickslip_ros.show.quantities import Units
from stickslip_ros.theory.bifurcation_branches import BifurcationBranches, Branch
from stickslip_ros.theory.gain_intervals import gains_of
from stickslip_ros.theory.linear_sampled_loop import settling_time
from stickslip_ros.theory.stability_map import StabilityMap

_CHARTS = (
    ("map", stability_map, "Stability over the gains", "limit of stability over the gains"),
    ("bifurcation", bifurcation, "Bifurcation diagram, no control", "displacement over belt speed"),
    ("friction", friction_curve, "Friction", "friction coefficient over relative speed"),
    ("decay", decay, "Closed-loop poles", "closed-loop poles in the complex plane"),
)
"""Name, computation, title, and text for readers of screens."""

Options = dict[str, Any]

_LARGEST_EXPONENT = 4.0
"""Largest size of an exponent that is drawn, in natural angular frequencies."""
_PARTS = ("real", "1/s"), ("imaginary", "rad/s")
_LEFT_OF_IT, _RIGHT_OF_IT, _ABOVE_IT = "insideEndTop", "insideEndBottom", "end"
"""Positions of the text of a vertical line, as ECharts names them."""
_DIGITS = 5
"""Significant digits of what is sent to the page."""


class TheoryPanel:
    """Charts of the theory, each with the present state as a point, or why there is none."""

    def __init__(self, run: RunState, theory: Theory) -> None:
        """Add the charts."""
        self._run, self._theory = run, theory
        self.charts: dict[str, ui.echart] = {}
        """The charts by name."""
        self._said: dict[str, ui.label] = {}
        self._drawn: dict[str, Any] = {}
        with ui.element("div").classes("theory"):
            for name, _, title, text in _CHARTS:
                with card(title):
                    self._said[name] = ui.label("").classes("text-sm")
                    self.charts[name] = chart({"series": []}, text)

    def refresh(self) -> None:
        """Draw what has changed."""
        self._theory.follow()
        drive = self._run.drive
        if drive is None:
            return
        gains = self._gains()
        places: dict[str, Any] = {"map": gains, "bifurcation": drive.belt_speed}
        for name, computation, _, _ in _CHARTS:
            result = self._theory.result(computation)
            state = (result.version, places.get(name))
            if self._drawn.get(name) == state or not result.version:
                continue
            self._drawn[name] = state
            self.charts[name].set_visibility(not result.refusal)
            self._said[name].set_text(result.refusal)
            if result.value is not None:
                draw = partial(stability_chart, gains=gains) if name == "map" else _DRAWN[name]
                self.charts[name].options.clear()
                self.charts[name].options.update(draw(result.value, drive))
                self.charts[name].update()
                self._explain(name, result.value, Units.for_drive(drive))

    def _explain(self, name: str, value: Any, units: Units) -> None:
        if name == "friction":  # page.js draws the loop of a law with a memory
            scale, _ = units.axis("", "m/s", value.relative_speed)
            call("scaleFriction", scale)
        if name == "decay":
            self._said[name].set_text(_decay_text(value, units))

    def _gains(self) -> Washout | None:
        """Return the gains of the controller; None while they are not known, or it has others."""
        law = self._run.law
        values = self._run.parameters[controller_node(law)]
        try:
            return gains_of(CONTROLLER_PARAMETERS[law].changed(values, law).control_law)
        except InvalidInputError:  # a controller of another version
            return None


def _decay_text(result: Decay, units: Units) -> str:
    def named(rate: float) -> str:
        name = "growth rate" if rate < 0.0 else "decay rate"
        return f"{name} {abs(rate):.3g} {units.of_unit('1/s')}".rstrip()

    without = named(result.uncontrolled_rate)
    if result.rate is None:
        return without
    text = f"{named(result.rate)} (without control: {without})"
    settles = settling_time(result.rate)
    return text if settles is None else f"{text}, settles in {units.text(settles, 's')}"


def bifurcation_chart(branches: BifurcationBranches, drive: Drive) -> Options:
    """Return least and greatest displacement over the belt speed, and the present belt speed."""
    units = Units.for_drive(drive)
    limit_sets = (*branches.equilibria, *branches.cycles)
    speeds = [branch.belt_speeds for branch in limit_sets]
    reaches = [side for branch in limit_sets for side in (branch.least, branch.greatest)]
    speed, speed_label = units.axis(units.plain("belt speed"), "m/s", *speeds)
    reach, reach_label = units.axis(units.plain("displacement"), "m", *reaches)

    def drawn(branch: Branch, what: str, colour: str, side: FloatArray) -> Options:
        name = f"{'stable' if branch.stable else 'unstable'} {what}"
        style = "solid" if branch.stable else "dashed"
        return _line(name, branch.belt_speeds / speed, side / reach, colour, style, width=2.0)

    series = [drawn(b, "equilibrium", GREEN, b.greatest) for b in branches.equilibria]
    for branch in branches.cycles:
        series += [drawn(branch, "cycle", ORANGE, s) for s in (branch.least, branch.greatest)]
    # Marks may be close to each other: their texts stand on different sides.
    marks = [(hopf.belt_speed / speed, "Hopf", GREY, _RIGHT_OF_IT) for hopf in branches.hopf_points]
    if branches.sticking_onset is not None:
        marks.append((branches.sticking_onset / speed, "stick-slip onset", GREY, _LEFT_OF_IT))
    series.append(_verticals([*marks, (drive.belt_speed / speed, "now", BLUE, _ABOVE_IT)]))
    return _options(speed_label, reach_label, series)


def stability_chart(stability: StabilityMap, drive: Drive, gains: Washout | None) -> Options:
    """Return the limit of stability over the gains, and the present gains, if any, as a point."""
    units = Units.for_drive(drive)
    gain, label = units.axis(units.plain("linear gain"), "N s/m", stability.linear_gains)
    corners, linear = stability.corner_frequencies, stability.linear_gains / gain
    contours: Any = contour_generator(corners, linear, stability.decay_rates.T)
    fastest = float(np.nanmax(stability.decay_rates, initial=0.0))
    series = [
        _line("limit of stability", contour[:, 0], contour[:, 1], ORANGE, width=2.5)
        for contour in contours.lines(0.0)
    ]
    continuous = stability.continuous / gain
    inside = (continuous >= linear[0]) & (continuous <= linear[-1])
    shown = np.where(inside, continuous, np.nan)
    series.append(_line("limit, not sampled", corners, shown, GREY, "dashed"))
    if gains is not None:
        series.append(_point("gains in use", gains.corner_frequency, gains.linear_gain / gain))
    for share, style in ((0.25, "dotted"), (0.5, "dashed"), (0.75, "solid")):
        if fastest > 0.0:
            level = float(f"{share * fastest:.1g}")
            name = f"decay rate {level:g} {units.of_unit('1/s')}".rstrip()
            series += [
                _line(name, contour[:, 0], contour[:, 1], SKY_BLUE, style, width=1.2)
                for contour in contours.lines(level)
            ]
    series += _regions(stability, linear)
    options = _options(units.label(units.plain("cutoff frequency"), "rad/s"), label, series)
    options["xAxis"] |= {"type": "log", "min": float(corners[0]), "max": float(corners[-1])}
    options["yAxis"] |= {"min": float(linear[0]), "max": float(linear[-1])}
    return options


def friction_chart(curve: FrictionCurve, drive: Drive) -> Options:
    """Return the friction curve and the operating point.

    The second series is for the loop of a law with a memory, which page.js draws.
    """
    units = Units.for_drive(drive)
    relative = units.plain("velocity relative to the belt")
    speed, label = units.axis(relative, "m/s", curve.relative_speed)
    series = [_line("in steady slip", curve.relative_speed / speed, curve.coefficient, GREY)]
    if drive.friction.states:
        series.append(line("motion", BLUE))
    if drive.belt_speed:
        rest = float(drive.friction.at_rest(drive.belt_speed))
        series.append(_point("steady sliding", -drive.belt_speed / speed, rest))
    return _options(label, units.plain("friction coefficient"), series)


def decay_chart(decay: Decay, drive: Drive) -> Options:
    """Return the exponents of the sampled loop: deviations decay left of the dotted line.

    Exponents that are much faster than the drive itself are left out.
    """
    units = Units.for_drive(drive)
    reach = _LARGEST_EXPONENT * drive.angular_frequency
    series: list[Options] = []
    for name, values, colour, symbol in (
        ("without control", decay.uncontrolled, ORANGE, "triangle"),
        ("with control", decay.controlled, BLUE, "circle"),
    ):
        places = [[_number(s.real), _number(s.imag)] for s in values if abs(s) < reach]
        if places:
            series.append(points(name, colour, 10, symbol) | {"data": places})
    series.append(_verticals([(0.0, "limit of stability", GREY, _LEFT_OF_IT)]))
    real, imaginary = (units.label(f"{part} part", unit) for part, unit in _PARTS)
    return _options(real, imaginary, series)


def _regions(stability: StabilityMap, linear: Any) -> Iterable[Options]:
    """Yield "stable" and "unstable", each at the median place of its region."""
    label = {"show": True, "fontStyle": "italic", "fontSize": 12, "color": GREY}
    for text, inside in (
        ("stable", stability.decay_rates > 0.0),
        ("unstable", stability.decay_rates < 0.0),
    ):
        rows, columns = np.nonzero(inside)
        if len(rows) > 20:
            corner = stability.corner_frequencies[int(np.median(rows))]
            place = [_number(corner), _number(linear[int(np.median(columns))])]
            look = {"silent": True, "label": label | {"formatter": text}, "data": [place]}
            yield points("", GREY, 1) | look


def _options(x: str, y: str, series: Sequence[Options]) -> Options:
    names = dict.fromkeys(s["name"] for s in series if s["name"])
    return {
        **STILL,
        "legend": LEGEND | {"data": list(names)},
        "grid": {"left": 60, "right": 34, "top": 90, "bottom": 45},
        "toolbox": TOOLBOX | {"orient": "vertical", "top": 84},  # the legend needs the whole width
        "tooltip": {"trigger": "item", "axisPointer": {"type": "cross"}},
        "xAxis": AXIS | CENTRED | {"name": x},
        "yAxis": AXIS | {"name": y, "nameGap": 24},  # above the text of a line
        "series": list(series),
    }


def _line(
    name: str, x: Any, y: Any, colour: str, style: str = "solid", *, width: float = 1.5
) -> Options:
    series = line(name, colour, style)
    series["lineStyle"]["width"] = width
    series["data"] = [[_number(a), _number(b)] for a, b in zip(x, y, strict=True)]
    return series


def _point(name: str, x: float, y: float) -> Options:
    return points(name, GREEN, 14, "diamond") | {"z": 5, "data": [[_number(x), _number(y)]]}


def _verticals(marks: Iterable[tuple[float, str, str, str]]) -> Options:
    """Return vertical lines at (place, text, colour, position of the text)."""
    lines = [
        {
            "xAxis": _number(place),
            "lineStyle": {"color": colour, "type": "dotted", "width": 1.5},
            "label": {"formatter": text, "position": position, "color": colour},
        }
        for place, text, colour, position in marks
    ]
    drawn = {"symbol": "none", "silent": True, "animation": False, "data": lines}
    return {"type": "line", "name": "", "data": [], "markLine": drawn}


def _number(value: Any) -> float | None:
    """Return a number with the digits that a chart needs; None, a gap, for NaN."""
    return float(f"{float(value):.{_DIGITS}g}") if np.isfinite(value) else None


_DRAWN = {"bifurcation": bifurcation_chart, "friction": friction_chart, "decay": decay_chart}
"""What draws a result in a chart, by name, where the gains have no part in it."""
