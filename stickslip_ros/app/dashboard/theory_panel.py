"""The part of the page that shows the theory of the running drive."""

from functools import partial
from typing import Any

from nicegui import ui

from stickslip_ros.app.dashboard.elements import call, card, chart
from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.app.dashboard.theory import (
    Decay,
    Theory,
    bifurcation,
    decay,
    friction_curve,
    stability_map,
)
from stickslip_ros.app.dashboard.theory_charts import (
    bifurcation_chart,
    decay_chart,
    friction_chart,
    stability_chart,
)
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import Washout
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, controller_node
from stickslip_ros.show.quantities import Units
from stickslip_ros.theory.gain_intervals import gains_of
from stickslip_ros.theory.linear_sampled_loop import settling_time

_CHARTS = (
    ("map", stability_map, "Stability over the gains", "limit of stability over the gains"),
    ("bifurcation", bifurcation, "Bifurcation diagram, no control", "displacement over belt speed"),
    ("friction", friction_curve, "Friction", "friction coefficient over relative speed"),
    ("decay", decay, "Closed-loop poles", "closed-loop poles in the complex plane"),
)
"""Name, computation, title, and text for readers of screens."""
_DRAWN = {"bifurcation": bifurcation_chart, "friction": friction_chart, "decay": decay_chart}
"""What draws a result in a chart, by name, where the gains have no part in it."""


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
