"""What the page says of a run that has ended: its measures, its bag, and what to do next."""

import asyncio
import shlex
from pathlib import Path
from typing import Any

from nicegui import ui

from stickslip_ros.app.dashboard.elements import heading, show_commands
from stickslip_ros.app.dashboard.listener import ListenerNode
from stickslip_ros.bags.report import report_of_bag
from stickslip_ros.errors import BagError
from stickslip_ros.plots.measure_table import LABELS, measure_table
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.files import shipped_scenarios
from stickslip_ros.scenarios.parameters import PlantParameters

_LARGEST = 200_000_000
"""Bytes of a bag that the page offers."""

_SHOWN = ("regime", "amplitude", "period", "stick_fraction", "duration", "samples", "lost_samples")


class EndedRun:
    """The bag of a run that has ended, and its report."""

    def __init__(self, listener: ListenerNode) -> None:
        self._listener = listener
        self._report: dict[str, Any] = {}
        self._problem = ""
        self._read_path: Path | None = None
        self._reading = asyncio.Lock()

    @property
    def bag(self) -> Path | None:
        """The bag that the analyzer has written; None if it has written none."""
        name = self._listener.health["analyzer"].figures.get("bag")
        return Path(name) if name else None

    @property
    def file(self) -> Path | None:
        """The MCAP file of the bag; None if there is none here, or it is too large to offer."""
        bag = self.bag
        if bag is None or bag != self._read_path or not self._report:
            return None
        files = sorted(bag.glob("*.mcap"))
        one = files[0] if len(files) == 1 else None
        return one if one is not None and one.stat().st_size <= _LARGEST else None

    async def read(self) -> None:
        """Read the report of the bag, once; concurrent callers wait for it."""
        async with self._reading:
            bag = self.bag
            if bag is None or bag == self._read_path:
                return
            try:
                self._report, self._problem = await asyncio.to_thread(report_of_bag, bag), ""
            except BagError as error:
                self._report, self._problem = {}, str(error) if bag.exists() else ""
            self._read_path = bag

    def show(self) -> None:
        """Add it to the page."""
        heading(2, "Run ended", "text-lg font-bold")
        if self._report:
            plant = self._listener.parameters["plant"]
            units = Units.for_drive(PlantParameters.validated(plant, "plant").as_drive())
            table = measure_table("", {"": self._report}, {"": units})
            shown = [LABELS[name][0] for name in _SHOWN]
            with ui.row().classes("gap-x-6 gap-y-1"):
                for label, text in table.rows:
                    if label in shown:
                        ui.label(f"{label}: {text}")
        if self._problem:
            ui.label(self._problem)
        bag = self.bag
        if bag is not None:
            there = "" if bag.exists() else ", on the machine of the analyzer"
            ui.label(f"Recorded in {bag}{there}")
            with ui.row().classes("gap-3"):
                if self.file is not None:
                    ui.link("Download the bag", "/bag.mcap").props(f'download="{bag.name}.mcap"')
        ui.label("In a terminal:")
        commands = [f"stickslip report {shlex.quote(str(bag))}"] if bag is not None else []
        namespace = self._listener.get_namespace()
        scenario = namespace.strip("/")  # by default a drive's namespace is that of its scenario
        if scenario not in shipped_scenarios():
            scenario = f"SCENARIO --namespace {namespace}"
        commands.append(f"stickslip run {scenario} --dashboard")
        show_commands(commands)
