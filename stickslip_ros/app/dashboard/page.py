"""The page: charts, measures, health and events of the nodes, and the controls for the user."""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from nicegui import ui
from nicegui.events import GenericEventArguments

from stickslip_ros.app.dashboard.charts import CYCLES, PORTRAIT, TRACE
from stickslip_ros.app.dashboard.frames import PERIODS, Frames
from stickslip_ros.app.dashboard.listener import ABSENT, SILENT, Answer, Health, ListenerNode
from stickslip_ros.messages.topics import AMPLITUDE, FREQUENCY, STICK_FRACTION
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.plots.regimes import REGIMES
from stickslip_ros.plots.style import BLUE, GREY, ORANGE
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.parameter_field import Fixed, Parameter, known_parameters
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    NODE_PARAMETERS,
    controller_node,
)

_REFRESH = 0.25


def add_page(app: FastAPI, listener: ListenerNode, frames: Frames) -> None:
    """Add the page and the frames of its charts."""
    script = Path(__file__).with_name("page.js").read_text(encoding="utf-8")

    @app.websocket("/frames")
    async def send_frames(socket: WebSocket) -> None:
        """Answer each request, a number of periods, with a frame."""
        if socket.headers.get("origin") != f"http://{socket.headers.get('host')}":
            await socket.close()  # a page of another site
            return
        await socket.accept()
        with suppress(WebSocketDisconnect):
            while (periods := await socket.receive_text()) in map(str, PERIODS):
                await socket.send_bytes(frames.frame(int(periods)))
            await socket.close()

    @ui.page("/")
    def page() -> None:
        _Page(listener, frames, script)


class _Page:
    """One open page; it keeps no state of the loop, so that closing it changes nothing."""

    def __init__(self, listener: ListenerNode, frames: Frames, script: str) -> None:
        self._listener = listener
        self._frames = frames
        self._busy = False
        self._newest_event = 0.0
        self._tap_scales: tuple[float, float] | None = None
        self._law: str | None = None
        self._fields: list[_ParameterField] = []
        with ui.row().classes("w-full items-center"):
            ui.label(listener.get_namespace()).classes("text-2xl font-bold")
            self._regime = ui.badge("").classes("text-base")
            self._trouble = ui.label("").classes("text-red-700")
            ui.space()
            self._window = ui.toggle(
                {periods: f"{periods} periods" for periods in PERIODS},
                value=PERIODS[1],
                on_change=self._show_window,
            )
            ui.button("Fit", on_click=lambda: ui.run_javascript("stickslip.fit()"))
        with ui.row().classes("w-full items-start lg:flex-nowrap"):
            with ui.column().classes("w-full lg:w-2/3"):
                trace = ui.echart(TRACE).classes("relative w-full h-[27rem]")
                with ui.row().classes("w-full sm:flex-nowrap"):
                    portrait = ui.echart(PORTRAIT).classes("relative w-full sm:w-1/2 h-80")
                    cycles = ui.echart(CYCLES).classes("w-full sm:w-1/2 h-80")
                self._add_health()
            with ui.column().classes("w-full lg:w-1/3"):
                self._add_measures()
                self._add_control()
                with _card("Parameters"):
                    self._parameters = ui.column().classes("w-full gap-2")
                with _card("Events"):
                    self._events = ui.log(max_lines=100).classes("w-full h-40")
        # Otherwise the scroll area is as wide as its longest line.
        ui.add_css(
            ".nicegui-log .q-scrollarea__content"
            "{white-space: pre-wrap !important; overflow-wrap: anywhere; width: 100%}"
        )
        start = {
            "trace": trace.id,
            "portrait": portrait.id,
            "cycles": cycles.id,
            "periods": PERIODS[1],
            "colours": {"BLUE": BLUE, "GREY": GREY, "ORANGE": ORANGE},
        }
        ui.add_body_html(
            f"<script>window.stickslip = {json.dumps(start)}</script>"
            f'<script type="module">{script}</script>'
        )
        ui.run_javascript("stickslip.start()")
        self._refresh()
        ui.timer(_REFRESH, self._refresh)

    def _add_measures(self) -> None:
        with _card("Last cycle"):
            self._measures: dict[Any, ui.label] = {}
            with ui.grid(columns=2).classes("w-full gap-1"):
                for topic, name in (
                    (AMPLITUDE, "amplitude"),
                    (STICK_FRACTION, "stick fraction"),
                    (FREQUENCY, "frequency"),
                ):
                    ui.label(name)
                    self._measures[topic] = ui.label("-")

    def _add_control(self) -> None:
        with _card("Control"):
            self._switch = ui.switch()
            self._switch.on("update:model-value", self._switch_control, [None])  # by the user only
            self._switch_refusal = _refusal()
            with ui.row().classes("items-end"):
                self._tap_force = ui.number("force (N)", value=None, format="%g").classes("w-24")
                self._tap_time = ui.number("duration (s)", value=None, format="%g").classes("w-24")
                ui.button("Impulse", on_click=self._tap)
                ui.button("Reset", on_click=self._reset)
            self._act_refusal = _refusal()

    def _show_controller(self, law: str) -> None:
        """Label the switch, and add the fields of the plant and the controller of a law."""
        self._law = law
        node = controller_node(law)
        self._switch.text = node.replace("_", " ")
        first = ["plant.belt_speed", *(f"{node}.{name}" for name in _own_constants(law))]
        others = [
            f"{each}.{name}"
            for each in ("plant", node)
            for name, parameter in known_parameters(NODE_PARAMETERS[each]).items()
            if _is_adjustable(parameter)
        ]
        self._parameters.clear()
        with self._parameters:
            self._fields = [
                _ParameterField(self._listener, name, lambda n=name: n) for name in first
            ]
            chosen = ui.select(
                [name for name in others if name not in first], label="another parameter"
            )
            chosen.classes("w-full").props("dense")
            self._fields.append(_ParameterField(self._listener, "value", lambda: chosen.value))

    def _add_health(self) -> None:
        columns = [
            {"name": name, "label": name, "field": name, "align": "left"}
            for name in ("node", "state", "health", "values")
        ]
        with _card("Nodes"):
            self._health = ui.table(columns=columns, rows=[], row_key="node")
            self._health.classes("w-full").props("wrap-cells flat dense")

    def _refresh(self) -> None:
        listener, drive = self._listener, self._frames.drive
        units = Units.for_drive(drive)
        for topic, label in self._measures.items():
            values = listener.cycles[topic]
            unit = {AMPLITUDE: "m", FREQUENCY: "Hz"}.get(topic, "")
            largest = max(values, default=0.0)
            label.set_text(units.text(values[-1] if values else None, unit, largest=largest))
        self._show_regime(listener.health["analyzer"])
        self._trouble.set_text(", ".join(self._missing()))
        scales = None
        if drive is not None:
            scales = drive.normal_force, drive.natural_period if drive.has_spring else 1.0
        if scales is not None and scales != self._tap_scales:
            self._tap_scales = scales
            for field, scale, label in (
                (self._tap_force, scales[0], units.label("force", "N")),
                (self._tap_time, scales[1], units.label("duration", "s")),
            ):
                field.value = float(f"{scale / 4.0:.2g}")
                field.props["label"] = label
        if self._law != listener.law:
            self._show_controller(listener.law)
        for field in self._fields:
            field.refresh(units)
        there = self._state_of_controller() not in (ABSENT, SILENT)
        self._switch.set_enabled(there and not self._busy)
        if not self._busy:
            self._switch.set_value(self._is_active())
        rows = [_row(node, health) for node, health in sorted(listener.health.items())]
        if rows != self._health.rows:
            self._health.rows = rows
        events = [event for event in list(listener.events) if event[0] > self._newest_event]
        for when, what in events:
            self._events.push(f"{time.strftime('%H:%M:%S', time.localtime(when))} {what}")
            self._newest_event = when

    def _missing(self) -> list[str]:
        return [
            f"{node} {health.state}"
            for node, health in self._listener.health.items()
            if health.state in (ABSENT, SILENT)
        ]

    def _show_regime(self, analyzer: Health) -> None:
        regime = analyzer.figures.get("regime") if analyzer.state == "active" else None
        known = regime in list(Regime)
        look = REGIMES[Regime(regime) if known else None]
        trend = analyzer.figures.get("trend") if known else None
        if trend:  # the motion differs from the cycles that the regime is taken from
            self._regime.set_text(f"not steady: {trend}")
        else:
            self._regime.set_text(look.label if known else "not measured")
        colour = GREY if trend else look.colour
        self._regime.style(f"background-color: {colour} !important")

    def _is_active(self) -> bool:
        return self._state_of_controller() == "active"

    def _state_of_controller(self) -> str:
        return self._listener.health.get(self._listener.controller, Health()).state

    def _switch_control(self, event: GenericEventArguments) -> Awaitable[None] | None:
        """Read the request from the event, since a refresh may set the switch back."""
        active = bool(event.args)
        if self._busy or active == self._is_active():
            return None
        self._busy = True
        self._switch.set_value(active)
        return self._pursue_control(active)

    async def _pursue_control(self, active: bool) -> None:
        try:
            answer = self._listener.set_active(self._listener.controller, active)
            await _report(answer, self._switch_refusal)
            deadline = time.monotonic() + 3.0
            while active != self._is_active() and time.monotonic() < deadline:
                await asyncio.sleep(_REFRESH)
        finally:
            self._busy = False

    async def _tap(self) -> None:
        force, duration = self._tap_force.value, self._tap_time.value
        if force is None or duration is None:
            self._act_refusal.set_text("an impulse needs a force and a duration")
            return
        await _report(self._listener.tap(force, duration), self._act_refusal)

    async def _reset(self) -> None:
        await _report(self._listener.reset(), self._act_refusal)

    def _show_window(self, event: Any) -> None:
        ui.run_javascript(f"stickslip.periods = {int(event.value)}; stickslip.fit()")


class _ParameterField:
    """An input field for a parameter, with its current value and the reason of a refusal."""

    def __init__(
        self, listener: ListenerNode, label: str, name_of: Callable[[], str | None]
    ) -> None:
        """Add the field; `name_of` returns the parameter that it sets, as NODE.PARAMETER."""
        self._listener = listener
        self._name_of = name_of
        self._hint = ""
        self._field = ui.input(label).classes("w-full").props("dense")
        self._field.on("keydown.enter", self._apply)
        with self._field.add_slot("append"):
            ui.button("Set", on_click=self._apply).props("flat dense")
        self._refusal = _refusal()

    def refresh(self, units: Units) -> None:
        """Show the current value."""
        hint = self._current_value(units)
        if hint != self._hint:
            self._hint = hint
            self._field.props["hint"] = hint

    async def _apply(self) -> None:
        full_name = self._name_of()
        if full_name is None:
            self._refusal.set_text("choose a parameter first")
            return
        text: str = self._field.value or ""
        try:
            value = float(text)
        except ValueError:
            self._refusal.set_text(f"{text!r} is not a number")
            return
        node, _, name = full_name.partition(".")
        await _report(self._listener.set_parameter(node, name, value), self._refusal)

    def _current_value(self, units: Units) -> str:
        full_name = self._name_of()
        if full_name is None:
            return ""
        node, _, name = full_name.partition(".")
        value = self._listener.parameters[node].get(name)
        unit = units.of_unit(known_parameters(NODE_PARAMETERS[node])[name].unit or "")
        number = f"{value:g}" if isinstance(value, float) else value
        return "unknown" if value is None else f"now {number} {unit}".rstrip()


def _own_constants(law: str) -> list[str]:
    """Return the adjustable parameters of a controller that are constants of its own law only."""
    common = constants_of(ControlLaw)
    parameters = known_parameters(CONTROLLER_PARAMETERS[law])
    return [
        name
        for name in CONTROL_LAWS[law].constants()
        if name not in common and name in parameters and _is_adjustable(parameters[name])
    ]


def _is_adjustable(parameter: Parameter) -> bool:
    return parameter.kind is float and parameter.fixed is Fixed.NEVER


async def _report(answer: Answer, refusal: ui.label) -> None:
    """Wait for an answer and show it if it is a refusal."""
    refusal.set_text(await asyncio.wrap_future(answer))


def _card(title: str) -> ui.card:
    card = ui.card().classes("w-full gap-2 p-3")
    with card:
        ui.label(title).classes("font-bold")
    return card


def _refusal() -> ui.label:
    label = ui.label().classes("text-sm text-red-700")
    return label.bind_visibility_from(label, "text")


def _row(node: str, health: Health) -> dict[str, str]:
    levels = "OK", "warning", "error", "stale"
    level = levels[min(health.level, 3)] if health.heard_at else ""
    return {
        "node": node,
        "state": health.state,
        "health": f"{level}: {health.message}" if health.message else level,
        "values": ", ".join(
            f"{name} {value}" for name, value in health.figures.items() if value not in ("", "none")
        ),
    }
