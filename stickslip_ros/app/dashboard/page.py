"""The page: charts of motion and theory, measures, health and events, and the controls."""

import asyncio
import json
import shlex
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, Query, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import FileResponse
from nicegui import background_tasks, core, ui
from nicegui.events import GenericEventArguments

from stickslip_ros.app.dashboard.charts import CYCLES, PORTRAIT, TRACE
from stickslip_ros.app.dashboard.controls import (
    OtherParameter,
    Settings,
    SliderField,
    main_parameters,
    number_within,
    other_parameters,
    refusal_label,
    refusals_in,
    report,
)
from stickslip_ros.app.dashboard.elements import (
    call,
    card,
    chart,
    heading,
    named,
    show_commands,
    table,
)
from stickslip_ros.app.dashboard.ended_run import EndedRun
from stickslip_ros.app.dashboard.frames import PERIODS, Frames
from stickslip_ros.app.dashboard.listener import ABSENT, SILENT, Health, ListenerNode
from stickslip_ros.app.dashboard.theory import Theory
from stickslip_ros.app.dashboard.theory_panel import TheoryPanel
from stickslip_ros.measures.cycle_measures import RESTS, Regime
from stickslip_ros.model.drive import Drive
from stickslip_ros.quantities import number_of
from stickslip_ros.record.topics import AMPLITUDE, FREQUENCY, STICK_FRACTION
from stickslip_ros.scenarios.parameters import controller_node
from stickslip_ros.show.quantities import MEASURES, Units
from stickslip_ros.show.style import BLUE, GREEN, GREY, ORANGE, REGIMES, SKY_BLUE
from stickslip_ros.text import number_in

_REFRESH = 0.25
_EVENTS = 100
_FAREWELL_TIME = 5.0
"""Time, s, for open pages to fetch what they offer after the server has ended."""

_LEAVING_TIME = 0.5
"""Time, s, in which the nodes of a run that ends with the server have left."""
_MEASURES = (
    (AMPLITUDE, MEASURES["amplitude"], 0.0),
    (STICK_FRACTION, MEASURES["stick_fraction"], 0.0),
    (FREQUENCY, MEASURES["frequency"], None),
)
"""Topic and quantity of the measures of a cycle, and their values at rest."""

_HERE = Path(__file__).parent


class Pages:
    """The open pages of a server, and what they share."""

    def __init__(self, app: FastAPI, listener: ListenerNode, frames: Frames) -> None:
        """Add the page, the frames of its charts and its downloads."""
        self.theory = Theory(listener)
        self._listener = listener
        self._open: set[_Page] = set()
        ended = EndedRun(listener)
        for name in ("page.css", "page.js"):
            core.app.add_static_file(local_file=_HERE / name, url_path=f"/{name}", max_cache_age=0)

        @app.websocket("/frames")
        async def send_frames(socket: WebSocket) -> None:  # pyright: ignore[reportUnusedFunction]
            """Answer each request, a number of periods, with a frame."""
            if socket.headers.get("origin") != f"http://{socket.headers.get('host')}":
                await socket.close()  # a page of another site
                return
            await socket.accept()
            with suppress(WebSocketDisconnect):
                with suppress(KeyError):  # bytes in place of text
                    while (periods := await socket.receive_text()) in map(str, PERIODS):
                        await socket.send_bytes(frames.frame(int(periods)))
                await socket.close()

        @app.get("/shown.csv")
        def shown(  # pyright: ignore[reportUnusedFunction]
            periods: int, end: Annotated[float, Query(ge=0.0, le=9e9)]
        ) -> Response:
            """Return the samples that a page shows."""
            length = periods if periods in PERIODS else PERIODS[0]
            return Response(frames.table(length, end), media_type="text/csv")

        @app.get("/bag.mcap")
        def bag() -> Response:  # pyright: ignore[reportUnusedFunction]
            """Return the bag of a run that has ended."""
            if ended.file is None:
                return Response(status_code=404)
            return FileResponse(ended.file, media_type="application/octet-stream")

        @ui.page("/")
        def page() -> None:  # pyright: ignore[reportUnusedFunction]
            ui.add_head_html('<link rel="stylesheet" href="/page.css">')
            ui.add_body_html('<script type="module" src="/page.js"></script>')
            _Page(listener, self.theory, ended, self._open)

    async def take_leave(self) -> None:
        """Show the end of a run on open pages, with what they need once the server is gone."""
        left = time.monotonic() + _LEAVING_TIME
        while self._open and not self._listener.ended and time.monotonic() < left:
            await asyncio.sleep(0.05)
        if self._open and self._listener.ended:
            with suppress(TimeoutError):
                async with asyncio.timeout(_FAREWELL_TIME):
                    await asyncio.gather(*(page.show_end(last=True) for page in self._open))
        self.theory.close()


class _Page:
    """One open page; it keeps no state of the loop, so that closing it changes nothing."""

    def __init__(
        self,
        listener: ListenerNode,
        theory: Theory,
        ended: EndedRun,
        opened: "set[_Page]",
    ) -> None:
        self._listener = listener
        self._ended = ended
        self._description = "", "", ""
        self._busy = False
        self._newest_event = 0.0
        self._tap_scales: tuple[float, float] | None = None
        self._law: str | None = None
        self._fields: list[SliderField | OtherParameter] = []
        self._end_shown = False
        self._final = False
        self._regime_colour = ""
        ui.colors(primary=BLUE)
        ui.dark_mode(value=None)
        with ui.element("div").classes("whole") as whole:
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
                    with card("Parameters"):
                        self._parameters = ui.column().classes("w-full gap-2")
                    with card("Compare two settings"):
                        switch = self._is_active, self._pursue_control
                        self._settings = Settings(listener, *switch, self._measured)
                    self._add_health()
                    with card("Events"):
                        self._events = ui.element("div").classes("events")
                        named(self._events.props("role=log tabindex=0"), "events")
                self._theory = TheoryPanel(listener, theory)
                self._charts |= self._theory.charts
        start = {
            **{name: chart.id for name, chart in self._charts.items()},
            "charts": [*self._charts],
            "periods": PERIODS[1],
            "colours": {
                "BLUE": BLUE, "GREEN": GREEN, "GREY": GREY, "ORANGE": ORANGE, "SKY_BLUE": SKY_BLUE,
            },
        }  # fmt: skip
        whole.props["data-start"] = json.dumps(start)
        self._refresh()
        ui.timer(_REFRESH, self._refresh)
        self._client = ui.context.client
        self._client.on_connect(lambda: opened.add(self))
        self._client.on_disconnect(lambda: opened.discard(self))

    def _add_header(self) -> None:
        with ui.row().classes("w-full items-center"):
            heading(1, self._listener.get_namespace()).classes("text-2xl")
            self._regime = ui.label("").classes("regime")
            self._wait = ui.label("").props("role=status")
            self._trouble = ui.label("").classes("refusal").props("role=alert")
            ui.link("Controls", "#controls").classes("to-controls")
            ui.space()
            window = ui.toggle(
                {periods: f"{periods} periods" for periods in PERIODS},
                value=PERIODS[1],
                on_change=lambda event: call("show", event.value),
            )
            window.props("no-caps outline")
            self._view = ui.button("Pause view", on_click=self._pause_view).props("outline no-caps")
            texts = "Fit", "CSV", "PNG"
            fit, csv, png = (ui.button(text).props("outline no-caps") for text in texts)
            fit.on("click", js_handler="() => stickslip.fit()")  # also after the server has ended
            csv.on("click", js_handler="() => stickslip.csv()")
            png.on("click", js_handler="() => stickslip.png()")
            self._facts = ui.label("").classes("w-full text-sm break-words")

    def _add_charts(self) -> None:
        self._charts: dict[str, ui.echart] = {}
        with card("Motion"):
            over_time = "displacement, velocity and force over time"
            self._charts["trace"] = chart(TRACE, over_time).classes("tall")
        with ui.element("div").classes("pair"):
            with card("Phase portrait"):
                self._charts["portrait"] = chart(PORTRAIT, "velocity over displacement")
            with card("Cycles"):
                each = "amplitude and stick fraction of each cycle"
                self._charts["cycles"] = chart(CYCLES, each)
                with ui.row().classes("w-full gap-4"):
                    self._measures: dict[Any, ui.label] = {}
                    for topic, quantity, _ in _MEASURES:
                        with ui.row().classes("gap-1"):
                            ui.label(quantity.label).classes("text-sm")
                            self._measures[topic] = ui.label("-").classes("text-sm font-bold")

    def _add_control(self) -> None:
        with card("Control"):
            self._switch = ui.switch()
            self._switch.on("update:model-value", self._switch_control, [None])  # by the user only
            self._switch_refusal = refusal_label()
            with ui.row().classes("items-end gap-2"):
                self._tap_force = ui.input("force (N)").classes("w-24")
                self._tap_time = ui.input("duration (s)").classes("w-24")
                ui.button("Impulse", on_click=self._tap).props("outline no-caps")
            ui.label("at first 1/4 of normal force and natural period").classes("text-sm")
            with ui.row().classes("items-end gap-2"):
                ui.button("Reset", on_click=self._reset).props("outline no-caps")
                self._pause = ui.button("Pause motion", on_click=self._pause_motion)
                self._pause.props("outline no-caps")
            self._act_refusal = refusal_label()

    def _add_health(self) -> None:
        with card("Nodes"):
            self._health = table(node="node", state="state", health="health")
            self._complaints = ui.label("").classes("text-sm whitespace-pre-line")
            with ui.expansion("all values").classes("w-full").props("dense"):
                self._raw = ui.label("").classes("text-xs whitespace-pre-wrap break-all")

    def _say_how_to_start(self) -> None:
        namespace = self._listener.get_namespace()
        heading(2, f"No drive is running in {namespace}").classes("text-lg")
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
        listener, drive, units = self._listener, self._listener.drive, self._listener.units
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
        self._describe(units)
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
                since = listener.time_of(event.stamp)
                simulated = "" if since is None else f", t = {units.text(since, 's')}"
                with self._events:
                    ui.label(f"{clock}{simulated}: {event.text}").move(target_index=0)
                for old in self._events.default_slot.children[_EVENTS:]:
                    self._events.remove(old)
                self._newest_event = event.when
        self._theory.refresh(drive)
        self._follow_end()

    def _measured(self) -> dict[str, str]:
        units = self._listener.units
        found: dict[str, str] = {}
        # At rest the last cycles are rounding errors.
        rests = self._listener.health["analyzer"].figures.get("regime") in RESTS
        for topic, (label, unit, _), at_rest in _MEASURES:
            values = self._listener.cycles[topic]
            value = values[-1] if values else None
            found[label] = units.text(at_rest if rests else value, unit)
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
                field.value = f"{float(f'{scale / 4.0:.2g}'):g}"
                field.props["label"] = label

    def _show_regime(self, analyzer: Health) -> None:
        regime = analyzer.figures.get("regime") if analyzer.state == "active" else None
        known = regime in list(Regime)
        look = REGIMES[Regime(regime) if known else None]
        trend = analyzer.figures.get("trend") if known else None
        if trend:  # the motion differs from the cycles that the regime is taken from
            self._regime.set_text(f"not steady: {trend}")
        elif known:
            self._regime.set_text(look.label)
        else:
            self._regime.set_text("run ended" if self._listener.ended else "not measured")
        colour = GREY if trend else look.colour
        if colour != self._regime_colour:
            self._regime_colour = colour
            self._regime.style["border-color"] = colour
            self._regime.update()

    def _show_health(self) -> None:
        health = sorted(self._listener.health.items())
        rows = [_row(node, each) for node, each in health]
        if rows != self._health.rows:
            self._health.rows = rows
        self._complaints.set_text(
            "\n".join(f"{node}: {each.message}" for node, each in health if each.message)
        )
        self._raw.set_text(
            "\n".join(
                f"{node}: " + ", ".join(f"{k} {v}" for k, v in each.figures.items() if v)
                for node, each in health
            )
        )

    def _describe(self, units: Units) -> None:
        """Tell time, lateness, bag and settings of the run; page.js names downloads by them."""
        listener, figures = self._listener, self._listener.health["plant"].figures
        samples, bag = number_in(figures.get("samples", "")), Path(self._ended.bag).name
        facts = [
            f"{name.replace('_', ' ')} {100.0 * number_in(figures[name]) / samples:.2g} %"
            for name in ("late_forces", "missed_deadlines")
            if samples and figures.get(name)
        ]
        facts.insert(0, f"t = {units.text(listener.time_of(listener.newest), 's')}")
        recording = "recording to" if listener.health["analyzer"].state == "active" else "bag"
        facts += [f"{recording} {bag}" if bag else "not recorded", listener.command]
        self._facts.set_text(", ".join(filter(None, facts)))
        namespace, settings = listener.get_namespace(), self._settings.described()
        description = listener.command or namespace, bag or namespace, settings
        # A run that ends switches control off, after the motion.
        ends = self._description[0] and listener.health["plant"].state != "active"
        if description != self._description and not ends:
            self._description = description
            call("describe", *description)

    def _follow_end(self) -> None:
        if not self._listener.ended:
            if self._end_shown:
                self._end_shown = False
                self._end.set_visibility(False)
                call("fit")
        elif not self._end_shown:
            self._end_shown = True
            background_tasks.create(self.show_end())

    async def show_end(self, *, last: bool = False) -> None:
        """Show that the run has ended; `last`: keep what is offered, as the server ends."""
        await self._ended.read()
        if self._final:
            return
        self._final = last
        with self._client:
            self._end_shown = True
            self._end.clear()
            with self._end:
                self._ended.show()
            self._end.set_visibility(True)
            if last:
                await ui.run_javascript("stickslip.end()", timeout=_FAREWELL_TIME)

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
        with refusals_in(self._act_refusal):
            force = number_within("force", self._tap_force.value, "N", self._listener.drive)
            duration = number_of("duration", self._tap_time.value, "s")
            await report(self._listener.tap(force, duration), self._act_refusal)

    async def _reset(self) -> None:
        await report(self._listener.reset(), self._act_refusal)

    def _pause_view(self) -> None:
        paused = self._view.text == "Pause view"
        self._view.set_text("Continue view" if paused else "Pause view")
        call("pause", paused)


def _row(node: str, health: Health) -> dict[str, str]:
    levels = "OK", "warning", "error", "stale"
    level = levels[min(health.level, 3)] if health.heard_at else ""
    return {"node": node, "state": health.state, "health": level}
