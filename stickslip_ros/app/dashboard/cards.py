"""Cards of the page: cycles, control, nodes and events."""

import asyncio
import time
from math import isnan

from nicegui import ui
from nicegui.events import GenericEventArguments

from stickslip_ros.app.dashboard.controls import number_within, refusal_label, refusals_in, report
from stickslip_ros.app.dashboard.elements import CYCLES, card, chart, named, table
from stickslip_ros.app.dashboard.run_requests import Impulse, Requests
from stickslip_ros.app.dashboard.run_state import ABSENT, SILENT, Health, RunState
from stickslip_ros.measures.cycle_measures import RESTS
from stickslip_ros.quantities import number_of
from stickslip_ros.record.topics import AMPLITUDE, FREQUENCY, STICK_FRACTION
from stickslip_ros.show.quantities import MEASURES

_EVENTS = 100
_LOOK_AGAIN = 0.25
_MEASURES = (
    (AMPLITUDE, MEASURES["amplitude"], 0.0),
    (STICK_FRACTION, MEASURES["stick_fraction"], 0.0),
    (FREQUENCY, MEASURES["frequency"], None),
)
"""Topic and quantity of the measures of a cycle, and their values at rest."""


class CyclesCard:
    """Chart of the cycles, and the measures of the last one."""

    def __init__(self, run: RunState) -> None:
        self._run = run
        with card("Cycles"):
            self.chart = chart(CYCLES, "amplitude and stick fraction of each cycle")
            with ui.row().classes("w-full gap-4"):
                self._values: dict[str, ui.label] = {}
                for _, quantity, _ in _MEASURES:
                    with ui.row().classes("gap-1"):
                        ui.label(quantity.label).classes("text-sm")
                        value = ui.label("-").classes("text-sm font-bold")
                        self._values[quantity.label] = value

    def refresh(self) -> None:
        """Show the measures."""
        for label, text in self.texts().items():
            self._values[label].set_text(text)

    def texts(self) -> dict[str, str]:
        """Return the measures of the last cycle by label, with units."""
        # At rest the last cycles are rounding errors.
        rests = self._run.health["analyzer"].figures.get("regime") in RESTS
        texts: dict[str, str] = {}
        for topic, (label, unit, _), at_rest in _MEASURES:
            cycles = self._run.cycles[topic]
            value = None if not cycles or isnan(cycles[-1]) else cycles[-1]
            texts[label] = self._run.units.text(at_rest if rests else value, unit)
        return texts


class ControlCard:
    """Switch of the controller, impulse, reset and pause, each with the reason of a refusal."""

    def __init__(self, run: RunState, requests: Requests, impulse: Impulse) -> None:
        self._run, self._requests, self._impulse = run, requests, impulse
        self.busy = False
        """Whether the controller is being switched."""
        self._impulse_scales: tuple[float, float] | None = None
        with card("Control"):
            self._switch = ui.switch()
            self._switch.on("update:model-value", self._switch_control, [None])  # by the user only
            self._switch_refusal = refusal_label()
            with ui.row().classes("items-end gap-2"):
                self._force = ui.input("force (N)").classes("w-24")
                self._duration = ui.input("duration (s)").classes("w-24")
                ui.button("Impulse", on_click=self._push).props("outline no-caps")
            ui.label("at first 1/4 of normal force and natural period").classes("text-sm")
            with ui.row().classes("items-end gap-2"):
                ui.button("Reset", on_click=self._reset).props("outline no-caps")
                self._pause = ui.button("Pause motion", on_click=self._pause_motion)
                self._pause.props("outline no-caps")
            self._refusal = refusal_label()

    def refresh(self) -> None:
        """Show the states of controller and plant; fill in an impulse that suits the drive."""
        self._switch.set_text(self._run.controller.replace("_", " "))
        there = self._run.controller_state not in (ABSENT, SILENT)
        self._switch.set_enabled(there and not self.busy)
        if not self.busy:
            self._switch.set_value(self._run.control_on)
        plant = self._run.health["plant"].state
        self._pause.set_text("Pause motion" if plant == "active" else "Continue motion")
        self._pause.set_enabled(plant in ("active", "inactive"))
        self._suggest_impulse()

    async def set_active(self, active: bool) -> None:
        """Switch the controller on or off, and wait until it is."""
        self.busy = True
        try:
            answer = self._requests.set_active(self._run.controller, active)
            await report(answer, self._switch_refusal)
            deadline = time.monotonic() + 3.0
            while active != self._run.control_on and time.monotonic() < deadline:
                await asyncio.sleep(_LOOK_AGAIN)
        finally:
            self.busy = False

    def _suggest_impulse(self) -> None:
        drive, units = self._run.drive, self._run.units
        if drive is None:
            return
        scales = drive.normal_force, drive.natural_period if drive.has_spring else 1.0
        if scales != self._impulse_scales:
            self._impulse_scales = scales
            for field, scale, label in (
                (self._force, scales[0], units.label("force", "N")),
                (self._duration, scales[1], units.label("duration", "s")),
            ):
                field.value = f"{float(f'{scale / 4.0:.2g}'):g}"
                field.props["label"] = label

    async def _switch_control(self, event: GenericEventArguments) -> None:
        """Read the request from the event, since a refresh may set the switch back."""
        active = bool(event.args)
        if not self.busy and active != self._run.control_on:
            self._switch.set_value(active)
            await self.set_active(active)

    async def _push(self) -> None:
        with refusals_in(self._refusal):
            force = number_within("force", self._force.value, "N", self._run.drive)
            duration = number_of("duration", self._duration.value, "s")
            await report(self._impulse.apply(force, duration), self._refusal)

    async def _reset(self) -> None:
        await report(self._requests.reset(), self._refusal)

    async def _pause_motion(self) -> None:
        active = self._run.health["plant"].state == "active"
        await report(self._requests.set_active("plant", not active), self._refusal)


class NodesCard:
    """State and health of each node, and all values of its diagnostics."""

    def __init__(self, run: RunState) -> None:
        self._run = run
        with card("Nodes"):
            self._table = table(node="node", state="state", health="health")
            self._complaints = ui.label("").classes("text-sm whitespace-pre-line")
            with ui.expansion("all values").classes("w-full").props("dense"):
                self._values = ui.label("").classes("text-xs whitespace-pre-wrap break-all")

    def refresh(self) -> None:
        """Show the last diagnostics."""
        nodes = sorted(self._run.health.items())
        rows = [_row(node, health) for node, health in nodes]
        if rows != self._table.rows:
            self._table.rows = rows
        self._complaints.set_text(
            "\n".join(f"{node}: {health.message}" for node, health in nodes if health.message)
        )
        self._values.set_text(
            "\n".join(
                f"{node}: " + ", ".join(f"{k} {v}" for k, v in health.figures.items() if v)
                for node, health in nodes
            )
        )


class EventsCard:
    """The last events, the newest first."""

    def __init__(self, run: RunState) -> None:
        self._run = run
        self._newest = 0.0
        with card("Events"):
            self._events = ui.element("div").classes("events")
            named(self._events.props("role=log tabindex=0"), "events")

    def refresh(self) -> None:
        """Add the new events."""
        for event in list(self._run.events):
            if event.when > self._newest:
                clock = time.strftime("%H:%M:%S", time.localtime(event.when))
                since = self._run.time_of(event.stamp)
                simulated = "" if since is None else f", t = {self._run.units.text(since, 's')}"
                with self._events:
                    ui.label(f"{clock}{simulated}: {event.text}").move(target_index=0)
                for old in self._events.default_slot.children[_EVENTS:]:
                    self._events.remove(old)
                self._newest = event.when


def _row(node: str, health: Health) -> dict[str, str]:
    levels = "OK", "warning", "error", "stale"
    level = levels[min(health.level, 3)] if health.heard_at else ""
    return {"node": node, "state": health.state, "health": level}
