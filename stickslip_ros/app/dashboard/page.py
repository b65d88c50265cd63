"""The page: charts of motion and theory, measures, health and events, and the controls."""

import asyncio
import json
import shlex
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from fastapi import FastAPI, Query, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import FileResponse
from nicegui import core, ui

from stickslip_ros.app.dashboard.cards import ControlCard, CyclesCard, EventsCard, NodesCard
from stickslip_ros.app.dashboard.controls import ParametersCard, Settings
from stickslip_ros.app.dashboard.elements import (
    PORTRAIT,
    TRACE,
    card,
    chart,
    heading,
    show_commands,
)
from stickslip_ros.app.dashboard.ended_run import EndedRun, EndNotice
from stickslip_ros.app.dashboard.frames import PERIODS, Frames
from stickslip_ros.app.dashboard.header import Header
from stickslip_ros.app.dashboard.listener import ListenerNode
from stickslip_ros.app.dashboard.theory import Theory
from stickslip_ros.app.dashboard.theory_panel import TheoryPanel
from stickslip_ros.show import BLUE, GREEN, GREY, ORANGE, SKY_BLUE

_REFRESH = 0.25
_FAREWELL_TIME = 5.0
"""Time, s, for open pages to fetch what they offer after the server has ended."""

_LEAVING_TIME = 0.5
"""Time, s, in which the nodes of a run that ends with the server have left."""

_HERE = Path(__file__).parent


class Pages:
    """The open pages of a server, and what they share."""

    def __init__(self, app: FastAPI, listener: ListenerNode, frames: Frames) -> None:
        """Add the page, the frames of its charts and its downloads."""
        self.theory = Theory(listener.run)
        self._listener = listener
        self._open = set[EndNotice]()
        ended = EndedRun(listener.run)
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
            end = _Page(listener, ended, self.theory).end
            ui.context.client.on_connect(lambda: self._open.add(end))
            ui.context.client.on_disconnect(lambda: self._open.discard(end))

    async def take_leave(self) -> None:
        """Show the end of a run on open pages, with what they need once the server is gone."""
        left = time.monotonic() + _LEAVING_TIME
        while self._open and not self._listener.ended and time.monotonic() < left:
            await asyncio.sleep(0.05)
        if self._open and self._listener.ended:
            with suppress(TimeoutError):
                async with asyncio.timeout(_FAREWELL_TIME):
                    await asyncio.gather(*(end.show(farewell=_FAREWELL_TIME) for end in self._open))
        self.theory.close()


class _Page:
    """One open page; it keeps no state of the loop, so that closing it changes nothing."""

    def __init__(self, listener: ListenerNode, ended: EndedRun, theory: Theory) -> None:
        self._run = run = listener.run
        ui.colors(primary=BLUE)
        ui.dark_mode(value=None)
        with ui.element("div").classes("whole") as whole:
            self._header = Header(listener, ended)
            self._empty = ui.element("section").classes("w-full notice")
            with self._empty:
                heading(2, f"No drive is running in {run.namespace}").classes("text-lg")
                ui.label("Start one in a terminal; this page shows it as soon as it is there:")
                command = ["stickslip", "run", "feed_drive", "--namespace", run.namespace]
                show_commands([shlex.join(command)])
            self.end = EndNotice(ended, listener)
            with ui.element("div").classes("board") as self._board:
                with ui.element("div").classes("charts"):
                    charts = self._add_charts()
                with ui.element("div").classes("controls").props("id=controls"):
                    self._add_controls(listener)
                theory_panel = TheoryPanel(run, theory)
        charts |= theory_panel.charts
        self._cards += [theory_panel, self.end]
        start = {
            **{name: chart.id for name, chart in charts.items()},
            "charts": [*charts],
            "periods": PERIODS[1],
            "colours": {
                "BLUE": BLUE, "GREEN": GREEN, "GREY": GREY, "ORANGE": ORANGE, "SKY_BLUE": SKY_BLUE,
            },
        }  # fmt: skip
        whole.props["data-start"] = json.dumps(start)
        self._refresh()
        ui.timer(_REFRESH, self._refresh)

    def _add_charts(self) -> dict[str, ui.echart]:
        charts: dict[str, ui.echart] = {}
        with card("Motion"):
            over_time = "displacement, velocity and force over time"
            charts["trace"] = chart(TRACE, over_time).classes("tall")
        with ui.element("div").classes("pair"):
            with card("Phase portrait"):
                charts["portrait"] = chart(PORTRAIT, "velocity over displacement")
            self._cycles = CyclesCard(self._run)
        return charts | {"cycles": self._cycles.chart}

    def _add_controls(self, listener: ListenerNode) -> None:
        run, requests = self._run, listener.requests
        self._control = ControlCard(run, requests, listener.impulse)
        parameters = ParametersCard(run, requests)
        with card("Compare two settings"):
            self._settings = Settings(run, requests, self._control.set_active, self._measures)
        self._cards = [
            self._cycles,
            parameters,
            self._settings,
            self._control,
            NodesCard(run),
            EventsCard(run),
        ]

    def _measures(self) -> dict[str, str]:
        return self._cycles.texts() | {"regime": self._header.regime}

    def _refresh(self) -> None:
        known = any(health.heard_at for health in self._run.health.values())
        self._empty.set_visibility(not known)
        self._board.set_visibility(known)
        self._header.refresh(switching=self._control.busy, settings=self._settings.described())
        for part in self._cards:
            part.refresh()
