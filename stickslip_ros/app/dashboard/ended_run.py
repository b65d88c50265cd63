"""A run that has ended: its measures, its bag, and what to do next."""

import asyncio
import shlex
from pathlib import Path
from typing import Any

from nicegui import background_tasks, ui

from stickslip_ros.app.dashboard.elements import call, heading, show_commands
from stickslip_ros.app.dashboard.listener import ListenerNode
from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import open_regular
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.show.measure_table import measure_table
from stickslip_ros.show.quantities import MEASURES
from stickslip_ros.text import printable

_LARGEST_BAG = 200_000_000
"""Bytes of a bag that the page offers."""

_MEASURES = (
    "regime",
    "amplitude",
    "period",
    "stick_fraction",
    "duration",
    "samples",
    "lost_samples",
)


class EndedRun:
    """The bag of a run that has ended, and its report.

    Any node may name a bag: it is read only if the run has it as readable.
    """

    def __init__(self, run: RunState) -> None:
        self._run = run
        self.file: Path | None = None
        """The MCAP file of the bag; None if there is none here, or it is too large to offer."""
        self._bag = ""
        self._report: dict[str, Any] = {}
        self._problem = ""
        self._reading = asyncio.Lock()

    @property
    def bag(self) -> str:
        """The bag that the analyzer says it has written; empty if there is none."""
        return self._run.health["analyzer"].figures.get("bag", "")

    async def read(self) -> None:
        """Read the report of the bag, once; concurrent callers wait for it."""
        async with self._reading:
            named = self.bag
            if named != self._bag and named in self._run.readable:
                await asyncio.to_thread(self._read, Path(named))
                self._bag = named

    def _read(self, bag: Path) -> None:
        """Read the report from the file that is offered, whatever has its name later."""
        self.file, self._report, self._problem, source = None, {}, "", bag
        try:
            self._open = [open_regular(file, links=False) for file in bag.glob("*.mcap")]
            if len(self._open) == 1:
                source = Path(f"/proc/self/fd/{self._open[0].fileno()}")
            self._report = report_of_recording(source)
            if source != bag and source.stat().st_size <= _LARGEST_BAG:
                self.file = source
        except OSError as error:
            self._problem = f"the file {error.filename} cannot be opened: {error.strerror}"
        except InvalidInputError as error:
            self._problem = str(error).replace(str(source), str(bag))

    def show(self) -> None:
        """Add it to the page."""
        plant = self._run.health["plant"]
        failure = f": {plant.message}" if plant.level == 2 and plant.message else ""
        heading(2, f"Run ended{failure}").classes("text-lg")
        bag, commands = self.bag, list[str]()
        if bag and bag == self._bag:
            if self._report:
                table = measure_table("", {"": self._report}, {"": self._run.units})
                measures = _MEASURES[1:] if failure else _MEASURES  # no regime of what came before
                shown = [MEASURES[name].label for name in measures]
                with ui.row().classes("gap-x-6 gap-y-1"):
                    for label, text in table.rows:
                        if label in shown:
                            ui.label(f"{label}: {text}")
            if self._problem:
                ui.label(self._problem)
            ui.label(f"Recorded in {bag}")
            if self.file is not None:
                link = ui.link("Download the bag", "/bag.mcap")
                link.props["download"] = f"{Path(bag).name}.mcap"
            commands.append(f"stickslip report {printable(shlex.quote(bag))}")
        elif bag:
            ui.label(f"Recorded in {bag}, as the analyzer says")
        ui.label("In a terminal:")
        namespace = self._run.namespace
        unknown = f"stickslip run SCENARIO --namespace {namespace} --dashboard"
        commands.append(self._run.command or unknown)
        show_commands(commands)


class EndNotice:
    """The part of a page that is there once the run has ended."""

    def __init__(self, ended: EndedRun, listener: ListenerNode) -> None:
        self._ended, self._listener = ended, listener
        self._shown = self._final = False
        self._client = ui.context.client
        self._notice = ui.element("section").classes("w-full notice")
        self._notice.set_visibility(False)

    def refresh(self) -> None:
        """Show it if the run has ended; hide it if there is another."""
        if not self._listener.ended:
            if self._shown:
                self._shown = False
                self._notice.set_visibility(False)
                call("fit")
        elif not self._shown:
            self._shown = True
            background_tasks.create(self.show())

    async def show(self, *, farewell: float = 0.0) -> None:
        """Show it; with a `farewell` for good, and what is offered is kept within that time, s."""
        await self._ended.read()
        if self._final:
            return
        self._final = farewell > 0.0
        with self._client:
            self._shown = True
            self._notice.clear()
            with self._notice:
                self._ended.show()
            self._notice.set_visibility(True)
            if farewell:
                await ui.run_javascript("stickslip.end()", timeout=farewell)
