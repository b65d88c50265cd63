"""The page: charts of motion and theory, measures, health and events, and the controls."""

import asyncio
import json
import shlex
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import FileResponse
from nicegui import background_tasks, ui
from nicegui.events import GenericEventArguments

from stickslip_ros.app.dashboard import theory_charts
from stickslip_ros.app.dashboard.charts import CYCLES, PORTRAIT, TRACE
from stickslip_ros.app.dashboard.controls import (
    OtherParameter,
    Settings,
    SliderField,
    main_parameters,
    other_parameters,
    refusal_label,
    report,
)
from stickslip_ros.app.dashboard.ended_run import EndedRun, show_commands
from stickslip_ros.app.dashboard.frames import PERIODS, Frames
from stickslip_ros.app.dashboard.listener import ABSENT, SILENT, Health, ListenerNode
from stickslip_ros.app.dashboard.theory import (
    Theory,
    bifurcation,
    decay,
    friction_curve,
    stability_map,
)
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.messages.topics import AMPLITUDE, FREQUENCY, STICK_FRACTION
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.theory.gain_intervals import gains_of
from stickslip_ros.physics.theory.linear_sampled_loop import settling_time
from stickslip_ros.plots.regimes import REGIMES
from stickslip_ros.plots.style import BLUE, GREEN, GREY, ORANGE, SKY_BLUE
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, controller_node

_REFRESH = 0.25
_EVENTS = 100
_FAREWELL = 5.0
"""Time, s, for open pages to fetch what they offer after the server has ended."""

_LATE = _FAREWELL - 0.5
"""Time before that, s, from which nodes that are still there stay there."""

_HERE = Path(__file__).parent


class Pages:
    """The open pages of a server, and what they share."""

    def __init__(self, app: FastAPI, listener: ListenerNode, frames: Frames) -> None:
        """Add the page, the frames of its charts and its downloads."""
        self.theory = Theory(listener)
        self._listener = listener
        self._open: set[_Page] = set()
        ended = EndedRun(listener)
        self._ended = ended
        self._script = (_HERE / "page.js").read_text(encoding="utf-8")
        self._look = (_HERE / "page.css").read_text(encoding="utf-8")

        @app.websocket("/frames")
        async def send_frames(socket: WebSocket) -> None:  # pyright: ignore[reportUnusedFunction]
            """Answer each request, a number of periods, with a frame."""
            if socket.headers.get("origin") != f"http://{socket.headers.get('host')}":
                await socket.close()  # a page of another site
                return
            await socket.accept()
            with suppress(WebSocketDisconnect):
                while (periods := await socket.receive_text()) in map(str, PERIODS):
                    await socket.send_bytes(frames.frame(int(periods)))
                await socket.close()

        @app.get("/shown.csv")
        def shown(periods: int, end: float) -> Response:  # pyright: ignore[reportUnusedFunction]
            """Return the samples that a page shows."""
            length = periods if periods in PERIODS else PERIODS[0]
            return Response(frames.table(length, end), media_type="text/csv")

        @app.get("/bag.mcap")
        def bag() -> Response:  # pyright: ignore[reportUnusedFunction]
            """Return the bag of a run that has ended."""
            file = ended.file
            return Response(status_code=404) if file is None else FileResponse(file)

        @ui.page("/")
        def page() -> None:  # pyright: ignore[reportUnusedFunction]
            ui.add_css(self._look)
            _Page(listener, frames, self.theory, ended, self._open)
            ui.add_body_html(f'<script type="module">{self._script}</script>')
            ui.run_javascript("stickslip.start()")

    async def take_leave(self) -> None:
        """Show the end of a run on open pages, with what they need once the server is gone."""
        deadline = time.monotonic() + _FAREWELL
        while self._open and not self._listener.ended and time.monotonic() < deadline - _LATE:
            await asyncio.sleep(0.05)
        if self._open and self._listener.ended:
            await self._ended.read()
            with suppress(TimeoutError):
                async with asyncio.timeout(max(deadline - time.monotonic(), 1.0)):
                    await asyncio.gather(*(page.show_end(last=True) for page in self._open))
        self.theory.close()


class _Page:
    """One open page; it keeps no state of the loop, so that closing it changes nothing."""

    def __init__(
        self,
        listener: ListenerNode,
        frames: Frames,
        theory: Theory,
        ended: EndedRun,
        opened: "set[_Page]",
    ) -> None:
        self._listener = listener
        self._frames = frames
        self._theory = theory
        self._ended = ended
        self._busy = False
        self._newest_event = 0.0
        self._tap_scales: tuple[float, float] | None = None
        self._law: str | None = None
        self._fields: list[SliderField | OtherParameter] = []
        self._drawn: dict[str, Any] = {}
        self._end_shown = False
        ui.colors(primary=BLUE)
        ui.dark_mode(value=None)
        with ui.element("div").classes("whole"):
            self._add_header()
            self._empty = ui.element("section").classes("w-full notice")
            with self._empty:
                self._say_how_to_start()
            self._end = ui.element("section").classes("w-full notice")
            self._end.set_visibility(False)
            with ui.element("div").classes("board") as self._board:
                with ui.element("div").classes("charts"):
                    self._add_charts()
                with ui.element("div").classes("controls").props("id=controls"):
                    self._add_control()
                    with _card("Parameters"):
                        self._parameters = ui.column().classes("w-full gap-2")
                    with _card("Compare two settings"):
                        self._settings = Settings(
                            listener, self._is_active, self._pursue_control, self._measured
                        )
                    self._add_health()
                    with _card("Events"):
                        self._events = ui.element("div").classes("events")
                        self._events.props('role=log tabindex=0 aria-label="events"')
                self._add_theory()
        start = {
            **{name: chart.id for name, chart in self._charts.items()},
            "charts": [*self._charts],
            "periods": PERIODS[1],
            "colours": {
                "BLUE": BLUE, "GREEN": GREEN, "GREY": GREY, "ORANGE": ORANGE, "SKY_BLUE": SKY_BLUE,
            },
        }  # fmt: skip
        ui.add_body_html(f"<script>window.stickslip = {json.dumps(start)}</script>")
        self._refresh()
        ui.timer(_REFRESH, self._refresh)
        opened.add(self)
        self._client = ui.context.client
        self._client.on_delete(lambda: opened.discard(self))

    def _add_header(self) -> None:
        with ui.row().classes("w-full items-center"):
            _heading(1, self._listener.get_namespace(), "text-2xl font-bold")
            self._regime = ui.label("").classes("regime")
            self._wait = ui.label("").props("role=status")
            self._trouble = ui.label("").classes("refusal").props("role=alert")
            ui.link("Controls", "#controls").classes("to-controls")
            ui.space()
            window = ui.toggle(
                {periods: f"{periods} periods" for periods in PERIODS},
                value=PERIODS[1],
                on_change=self._show_window,
            )
            window.props("no-caps outline")
            self._view = ui.button("Pause view", on_click=self._pause_view).props("outline no-caps")
            for text, call in (("Fit", "fit"), ("CSV", "csv"), ("PNG", "png")):
                button = ui.button(text, on_click=lambda c=call: _call(f"{c}()"))
                button.props("outline no-caps")

    def _add_charts(self) -> None:
        self._charts: dict[str, ui.echart] = {}
        with _card("Motion"):
            self._chart("trace", TRACE, "displacement, velocity and force over time", "tall")
        with ui.element("div").classes("pair"):
            with _card("Phase portrait"):
                self._chart("portrait", PORTRAIT, "velocity over displacement")
            with _card("Cycles"):
                self._chart("cycles", CYCLES, "amplitude and stick fraction of each cycle")
                with ui.row().classes("w-full gap-4"):
                    self._measures: dict[Any, ui.label] = {}
                    for topic, name in (
                        (AMPLITUDE, "amplitude"),
                        (STICK_FRACTION, "stick fraction"),
                        (FREQUENCY, "frequency"),
                    ):
                        with ui.row().classes("gap-1"):
                            ui.label(name).classes("text-sm")
                            self._measures[topic] = ui.label("-").classes("text-sm font-bold")

    def _add_theory(self) -> None:
        self._said: dict[str, ui.label] = {}
        with ui.element("div").classes("theory"):
            for name, title, text in (
                ("map", "Stability over the gains", "limit of stability over the gains"),
                ("bifurcation", "Bifurcation diagram, no control", "displacement over belt speed"),
                ("friction", "Friction", "friction coefficient over relative speed"),
                ("decay", "Exponents of the sampled loop", "exponents in the complex plane"),
            ):
                with _card(title):
                    self._said[name] = ui.label("").classes("text-sm")
                    self._chart(name, {"series": []}, text)

    def _chart(self, name: str, options: dict[str, Any], text: str, more: str = "") -> None:
        chart = ui.echart(options).classes(f"relative w-full chart {more}")
        self._charts[name] = chart.props(f'role=img aria-label="{text}"')

    def _add_control(self) -> None:
        with _card("Control"):
            self._switch = ui.switch()
            self._switch.on("update:model-value", self._switch_control, [None])  # by the user only
            self._switch_refusal = refusal_label()
            with ui.row().classes("items-end gap-2"):
                self._tap_force = ui.number("force (N)", value=None, format="%g").classes("w-24")
                self._tap_time = ui.number("duration (s)", value=None, format="%g").classes("w-24")
                ui.button("Impulse", on_click=self._tap).props("outline no-caps")
            with ui.row().classes("items-end gap-2"):
                ui.button("Reset", on_click=self._reset).props("outline no-caps")
                self._pause = ui.button("Pause motion", on_click=self._pause_motion)
                self._pause.props("outline no-caps")
            self._act_refusal = refusal_label()

    def _add_health(self) -> None:
        columns = [
            {"name": name, "label": name, "field": name, "align": "left"}
            for name in ("node", "state", "health")
        ]
        with _card("Nodes"):
            self._health = ui.table(columns=columns, rows=[], row_key="node")
            self._health.classes("w-full").props("wrap-cells flat dense hide-bottom")
            self._shares = ui.label("").classes("text-sm")
            with ui.expansion("all values").classes("w-full").props("dense"):
                self._raw = ui.label("").classes("text-xs whitespace-pre-wrap break-all")

    def _say_how_to_start(self) -> None:
        namespace = self._listener.get_namespace()
        _heading(2, f"No drive is running in {namespace}", "text-lg font-bold")
        ui.label("Start one in a terminal; this page shows it as soon as it is there:")
        command = ["stickslip", "run", "feed_drive"]
        show_commands([shlex.join([*command, "--namespace", namespace])])

    def _show_controller(self, law: str) -> None:
        """Label the switch, and add the fields of the plant and the controller of a law."""
        self._law = law
        self._switch.text = controller_node(law).replace("_", " ")
        self._parameters.clear()
        with self._parameters:
            self._fields = [SliderField(self._listener, name) for name in main_parameters(law)]
            self._fields.append(OtherParameter(self._listener, other_parameters(law)))

    def _refresh(self) -> None:
        listener, drive = self._listener, self._frames.drive
        units = Units.for_drive(drive)
        heard = any(health.heard_at for health in listener.health.values())
        self._empty.set_visibility(not heard)
        self._board.set_visibility(heard)
        for label, text in zip(self._measures.values(), self._measured().values(), strict=False):
            label.set_text(text)
        self._show_regime(listener.health["analyzer"])
        self._show_waits(units)
        self._show_scales(drive, units)
        if self._law != listener.law:
            self._show_controller(listener.law)
        for field in self._fields:
            field.refresh(units)
        self._settings.refresh()
        there = self._state_of_controller() not in (ABSENT, SILENT)
        self._switch.set_enabled(there and not self._busy)
        if not self._busy:
            self._switch.set_value(self._is_active())
        moving = listener.health["plant"].state == "active"
        self._pause.set_text("Pause motion" if moving else "Continue motion")
        self._pause.set_enabled(listener.health["plant"].state in ("active", "inactive"))
        self._show_health()
        for event in list(listener.events):
            if event.when > self._newest_event:
                clock = time.strftime("%H:%M:%S", time.localtime(event.when))
                with self._events:
                    ui.label(f"{clock} {event.text}").move(target_index=0)
                for old in self._events.default_slot.children[_EVENTS:]:
                    self._events.remove(old)
                self._newest_event = event.when
        self._show_theory(drive, units)
        self._follow_end()

    def _measured(self) -> dict[str, str]:
        units = Units.for_drive(self._frames.drive)
        found: dict[str, str] = {}
        for topic, name, unit in (
            (AMPLITUDE, "amplitude", "m"),
            (STICK_FRACTION, "stick fraction", ""),
            (FREQUENCY, "frequency", "Hz"),
        ):
            values = self._listener.cycles[topic]
            largest = max(values, default=0.0)
            found[name] = units.text(values[-1] if values else None, unit, largest=largest)
        return found | {"regime": self._regime.text}

    def _show_waits(self, units: Units) -> None:
        listener = self._listener
        if (left := listener.acts_in) > 0.0:
            self._wait.set_text(f"control acts in {left:.1f} {units.of_unit('s')}".rstrip())
        elif (left := listener.waits_for_reply) > 0.0:
            self._wait.set_text(f"waiting for the controller, {left:.0f} s")
        elif self._busy:
            self._wait.set_text("waiting for the controller")
        else:
            self._wait.set_text("")
        missing = [
            f"{node} {health.state}"
            for node, health in listener.health.items()
            if health.state in (ABSENT, SILENT)
        ]
        self._trouble.set_text("" if listener.ended else ", ".join(missing))

    def _show_scales(self, drive: Drive | None, units: Units) -> None:
        if drive is None:
            return
        scales = drive.normal_force, drive.natural_period if drive.has_spring else 1.0
        if scales != self._tap_scales:
            self._tap_scales = scales
            for field, scale, label in (
                (self._tap_force, scales[0], units.label("force", "N")),
                (self._tap_time, scales[1], units.label("duration", "s")),
            ):
                field.value = float(f"{scale / 4.0:.2g}")
                field.props["label"] = label

    def _show_regime(self, analyzer: Health) -> None:
        regime = analyzer.figures.get("regime") if analyzer.state == "active" else None
        known = regime in list(Regime)
        look = REGIMES[Regime(regime) if known else None]
        trend = analyzer.figures.get("trend") if known else None
        if trend:  # the motion differs from the cycles that the regime is taken from
            self._regime.set_text(f"not steady: {trend}")
        else:
            self._regime.set_text(look.label if known else "not measured")
        self._regime.style(f"border-color: {GREY if trend else look.colour}")

    def _show_health(self) -> None:
        health = sorted(self._listener.health.items())
        rows = [_row(node, each) for node, each in health]
        if rows != self._health.rows:
            self._health.rows = rows
        figures = self._listener.health["plant"].figures
        samples = int(figures.get("samples", "0") or 0)
        shares = [
            f"{name.replace('_', ' ')} {100.0 * int(figures.get(name, 0)) / samples:.2g} %"
            for name in ("late_forces", "missed_deadlines")
            if samples and figures.get(name, "").isdecimal()
        ]
        self._shares.set_text(", ".join(shares))
        self._raw.set_text(
            "\n".join(
                f"{node}: " + ", ".join(f"{k} {v}" for k, v in each.figures.items() if v)
                for node, each in health
            )
        )

    def _show_theory(self, drive: Drive | None, units: Units) -> None:
        self._theory.follow()
        if drive is None:
            return
        gains = self._gains()
        drawings: dict[str, tuple[Any, Any, Callable[[Any], Any]]] = {
            "bifurcation": (
                bifurcation,
                drive.belt_speed,
                lambda found: theory_charts.bifurcation_chart(found, drive),
            ),
            "friction": (
                friction_curve,
                None,
                lambda found: theory_charts.friction_chart(found, drive),
            ),
            "decay": (decay, None, lambda found: theory_charts.decay_chart(found, drive)),
        }
        if gains is not None:
            drawings["map"] = (
                stability_map,
                gains,
                lambda found: theory_charts.stability_chart(found, drive, gains),
            )
        for name, (computation, place, draw) in drawings.items():
            result = self._theory.result(computation)
            state = (result.version, place)
            if self._drawn.get(name) == state or not result.version:
                continue
            self._drawn[name] = state
            self._charts[name].set_visibility(not result.refusal)
            self._said[name].set_text(result.refusal)
            if result.value is not None:
                chart = self._charts[name]
                chart.options.clear()
                chart.options.update(draw(result.value))
                chart.update()
                if name == "friction":
                    scale, _ = units.axis("", "m/s", result.value.relative_speed)
                    ui.run_javascript(f"stickslip.frictionScale = {scale!r}")
                if name == "decay":
                    self._said[name].set_text(_decay_text(result.value, units))

    def _gains(self) -> WashoutGains | None:
        """Return the gains of the controller; None while they are not known, or it has others."""
        law = self._listener.law
        values = self._listener.parameters[controller_node(law)]
        try:
            return gains_of(CONTROLLER_PARAMETERS[law].validated(values, law).as_law())
        except InvalidInputError:  # a controller of another version
            return None

    def _follow_end(self) -> None:
        if not self._listener.ended:
            if self._end_shown:
                self._end_shown = False
                self._end.set_visibility(False)
                _call("restart()")
        elif not self._end_shown:
            self._end_shown = True
            background_tasks.create(self.show_end())

    async def show_end(self, *, last: bool = False) -> None:
        """Show that the run has ended; `last`: keep what is offered, as the server ends."""
        await self._ended.read()
        with self._client:
            self._end_shown = True
            self._end.clear()
            with self._end:
                self._ended.show()
            self._end.set_visibility(True)
            if last:
                await ui.run_javascript("return await stickslip.end()", timeout=_FAREWELL)

    def _is_active(self) -> bool:
        return self._state_of_controller() == "active"

    def _state_of_controller(self) -> str:
        return self._listener.health.get(self._listener.controller, Health()).state

    async def _switch_control(self, event: GenericEventArguments) -> None:
        """Read the request from the event, since a refresh may set the switch back."""
        active = bool(event.args)
        if not self._busy and active != self._is_active():
            self._switch.set_value(active)
            await self._pursue_control(active)

    async def _pursue_control(self, active: bool) -> None:
        self._busy = True
        try:
            answer = self._listener.set_active(self._listener.controller, active)
            await report(answer, self._switch_refusal)
            deadline = time.monotonic() + 3.0
            while active != self._is_active() and time.monotonic() < deadline:
                await asyncio.sleep(_REFRESH)
        finally:
            self._busy = False

    async def _pause_motion(self) -> None:
        active = self._listener.health["plant"].state == "active"
        await report(self._listener.set_active("plant", not active), self._act_refusal)

    async def _tap(self) -> None:
        force, duration = self._tap_force.value, self._tap_time.value
        if force is None or duration is None:
            self._act_refusal.set_text("an impulse needs a force and a duration")
            return
        await report(self._listener.tap(force, duration), self._act_refusal)

    async def _reset(self) -> None:
        await report(self._listener.reset(), self._act_refusal)

    def _show_window(self, event: Any) -> None:
        _call(f"show({int(event.value)})")

    def _pause_view(self) -> None:
        paused = self._view.text == "Pause view"
        self._view.set_text("Continue view" if paused else "Pause view")
        _call(f"pause({'true' if paused else 'false'})")


def _decay_text(found: Any, units: Units) -> str:
    unit = units.of_unit("1/s")
    without = f"{found.uncontrolled_rate:.3g} {unit}".rstrip()
    if found.rate is None:
        return f"decay rate {without}"
    text = f"decay rate {found.rate:.3g} {unit}".rstrip() + f" ({without} without control)"
    settles = settling_time(found.rate)
    return text if settles is None else f"{text}, settles in {units.text(settles, 's')}"


def _call(script: str) -> None:
    ui.run_javascript(f"stickslip.{script}")


def _heading(level: int, text: str, classes: str) -> None:
    with ui.element(f"h{level}").classes(classes):
        ui.label(text)


@contextmanager
def _card(title: str) -> Generator[None]:
    with ui.element("section").classes("panel"):
        _heading(2, title, "font-bold")
        yield


def _row(node: str, health: Health) -> dict[str, str]:
    levels = "OK", "warning", "error", "stale"
    level = levels[min(health.level, 3)] if health.heard_at else ""
    return {
        "node": node,
        "state": health.state,
        "health": f"{level}: {health.message}" if health.message else level,
    }
