"""Controls of the page: what sets a parameter, and what waits for the answer."""

import asyncio
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from math import ceil, floor, isfinite, log2, log10
from typing import Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from stickslip_ros.app.dashboard.elements import call, card, named, table
from stickslip_ros.app.dashboard.run_requests import Answer, Requests
from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import SMALLEST, Changes, Parameter, constants_of
from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.model.drive import Drive
from stickslip_ros.quantities import number_of
from stickslip_ros.scenarios.keywords import described
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    NODE_PARAMETERS,
    controller_node,
)
from stickslip_ros.show.quantities import Units, plain_name

_LARGEST_RATIO = 10.0
"""Allowed ratio of an input to the scale of the drive, or to the present value."""


def main_parameters(law: str) -> list[str]:
    """Return the parameters with a slider, as NODE.PARAMETER: belt speed and the gains of a law."""
    common = constants_of(ControlLaw)
    known = CONTROLLER_PARAMETERS[law].known
    gains = [
        f"{controller_node(law)}.{name}"
        for name in CONTROL_LAWS[law].constants()
        if name not in common and name in known and _is_adjustable(known[name])
    ]
    return ["plant.belt_speed", *gains]


def other_parameters(law: str) -> list[str]:
    """Return all other numbers that can be changed while the nodes run, as NODE.PARAMETER."""
    names = [
        f"{node}.{name}"
        for node in ("plant", controller_node(law))
        for name, parameter in NODE_PARAMETERS[node].known.items()
        if _is_adjustable(parameter)
    ]
    return [name for name in names if name not in main_parameters(law)]


def name_of(full_name: str) -> str:
    """Return the name of NODE.PARAMETER for a reader."""
    named = plain_name(full_name)
    return named if named != full_name else full_name.partition(".")[2].replace("_", " ")


def slider_range(value: float, parameter: Parameter) -> tuple[float, float, float]:
    """Return least and largest value and step of a slider around a value.

    The range is a round one that a smaller change of the value does not change.
    """
    scale = value if abs(value) >= SMALLEST else parameter.default or 1.0
    size = 2.0 ** (ceil(log2(abs(scale))) + 1)
    low, high = (0.0, size) if scale > 0.0 else (-size, 0.25 * size)
    if parameter.least is not None:
        low = max(low, 0.0 if abs(parameter.least) < 1e-20 else parameter.least)
    step = 10.0 ** floor(log10((high - low) / 100.0))
    return low, high, step


def current(run: RunState, full_name: str) -> Any:
    """Return the current value of NODE.PARAMETER; None if it is not known."""
    node, _, name = full_name.partition(".")
    return run.parameters[node].get(name)


def scale_of(unit: str, drive: Drive | None) -> float:
    """Return the scale (SI) of a quantity of a drive; 1 while the drive is not known."""
    return 1.0 if drive is None else float(f"{1.0 / drive.scales.factor(unit):.9g}")


def number_within(name: str, given: Any, unit: str, drive: Drive | None, now: Any = 0.0) -> float:
    """Return a number, or refuse it, also one of a size that would only end the run."""
    value = number_of(name, given, unit)
    limit = _LARGEST_RATIO * max(abs(now or 0.0), scale_of(unit, drive))
    if drive is not None and unit != "s" and isfinite(value) and abs(value) > limit:
        shown, most = (Units.for_drive(drive).text(v, unit) for v in (value, limit))
        raise InvalidInputError(
            f"{name} = {shown} is invalid: must be at most {most} in size, which is "
            f"{_LARGEST_RATIO:g} times the scale of this drive, or the present value"
        )
    return value


class SliderField:
    """Slider and number for a parameter, with its unit, undo and the reason of a refusal."""

    def __init__(self, run: RunState, requests: Requests, full_name: str) -> None:
        self._run, self._requests, self.full_name = run, requests, full_name
        self._parameter = described(full_name)
        self._scale, self._unit = 1.0, ""
        self._earlier: list[float] = []
        self._shown = ""
        self._outdated = False
        name = name_of(full_name)
        with ui.element("div").classes("w-full"):
            with ui.row().classes("w-full items-center no-wrap gap-1"):
                self._label = ui.label(name).classes("grow text-sm")
                self._number = ui.input().classes("w-28")
                named(self._number.props("dense outlined"), f"{name}, value")
                self._number.on("keydown.enter", self._enter)
                self._number.on("blur", self._enter)
                self._undo = ui.button(icon="undo", on_click=self._go_back)
                named(self._undo.props("flat dense round size=sm"), f"undo {name}")
            self._slider = ui.element("input").classes("w-full slider")
            named(self._slider.props("type=range"), name)
            self._slider.on("change", self._slide, js_handler="(e) => emit(e.target.value)")
            self._refusal = refusal_label()

    def refresh(self, units: Units) -> None:
        """Show the current value, in the unit of the plots, unless the user is changing it."""
        value, unit = current(self._run, self.full_name), self._parameter.unit or ""
        usual = scale_of(unit, self._run.drive) * (self._parameter.default or 1.0)
        self._scale, unit = units.prefixed(unit, value or usual)
        self._unit = units.of_unit(unit)
        named = units.plain(name_of(self.full_name))
        self._label.set_text(f"{named} ({self._unit})" if self._unit else named)
        known = isinstance(value, float)
        self._number.set_enabled(known)
        self._undo.set_enabled(known and bool(self._earlier))
        shown = f"{value / self._scale:.6g}" if known else ""
        if known and (self._outdated or shown != self._shown):
            self._shown, self._outdated = shown, False
            ends = slider_range(value or usual, self._parameter)
            low, high, step, place = (f"{number / self._scale:.9g}" for number in (*ends, value))
            # The value last: a range input keeps it within the limits that it has. The dot: as a
            # property that Vue sets when it changes, not whenever anything on the page does.
            self._slider.props.update({"min": low, "max": high, "step": step, ".value": place})
            self._number.set_value(self._shown)

    async def _slide(self, event: GenericEventArguments) -> None:
        self._slider.props[".value"] = event.args
        await self._set(float(f"{float(event.args) * self._scale:.9g}"))

    async def _enter(self) -> None:
        given, now = str(self._number.value), current(self._run, self.full_name)
        if given != self._shown:
            with suppress(ValueError):  # a number alone is in the unit that is shown
                given = f"{float(given)!r} {self._unit}".rstrip()
            with refusals_in(self._refusal):
                unit, drive = self._parameter.unit or "", self._run.drive
                await self._set(number_within(self.full_name, given, unit, drive, now))

    async def _go_back(self) -> None:
        if self._earlier:
            await self._set(self._earlier.pop(), again=True)

    async def _set(self, value: float, *, again: bool = False) -> None:
        before = current(self._run, self.full_name)
        answer = await asyncio.wrap_future(self._requests.set_parameter(self.full_name, value))
        self._refusal.set_text(answer)
        self._outdated = True  # what was typed gives way to the value that the node has
        if not answer and not again and before is not None and before != value:
            self._earlier.append(before)


class OtherParameter:
    """Any other parameter: a list with value, unit and meaning, and a field for a new value."""

    def __init__(self, run: RunState, requests: Requests, names: list[str]) -> None:
        self._run, self._requests, self._names = run, requests, names
        self._choice = ui.select(names, label="another parameter", with_input=True)
        self._choice.classes("w-full").props("dense outlined")
        self._meaning = ui.label().classes("text-sm")
        self._field = ui.input("value").classes("w-full").props("dense outlined")
        self._field.on("keydown.enter", self._apply)
        with self._field.add_slot("append"):
            ui.button("Set", on_click=self._apply).props("flat dense")
        self._refusal = refusal_label()
        self._options: dict[str, str] = {}

    def refresh(self, units: Units) -> None:
        """Show the current values."""
        options = {name: f"{name} = {self._value(name, units)}" for name in self._names}
        if options != self._options:
            self._options = options
            self._choice.set_options(options, value=self._choice.value)
        chosen = self._choice.value
        if chosen is None:
            self._meaning.set_text("")
        else:
            self._meaning.set_text(f"{described(chosen).meaning} Now {self._value(chosen, units)}.")

    def _value(self, full_name: str, units: Units) -> str:
        return units.text(current(self._run, full_name), described(full_name).unit or "")

    async def _apply(self) -> None:
        chosen = self._choice.value
        if chosen is None:
            self._refusal.set_text("choose a parameter first")
            return
        with refusals_in(self._refusal):
            unit, now = described(chosen).unit or "", current(self._run, chosen)
            value = number_within(chosen, self._field.value, unit, self._run.drive, now)
            await report(self._requests.set_parameter(chosen, value), self._refusal)


class ParametersCard:
    """A slider for each main parameter of the plant and of the controller, and all others."""

    def __init__(self, run: RunState, requests: Requests) -> None:
        """Add the card; its fields come with the first `refresh`."""
        self._run, self._requests = run, requests
        self._law: str | None = None
        self._fields: list[SliderField | OtherParameter] = []
        with card("Parameters"):
            self._column = ui.column().classes("w-full gap-2")

    def refresh(self) -> None:
        """Show the current values, of the controller that is there."""
        run, requests, law = self._run, self._requests, self._run.law
        if law != self._law:
            self._law = law
            self._column.clear()
            with self._column:
                self._fields = [SliderField(run, requests, name) for name in main_parameters(law)]
                self._fields.append(OtherParameter(run, requests, other_parameters(law)))
        units = run.units
        for field in self._fields:
            field.refresh(units)


@dataclass(frozen=True)
class Setting:
    """Parameters with a slider (in units), whether control is on; both and measures as texts."""

    values: dict[str, float]
    active: bool
    units: Units
    texts: dict[str, str]


class Settings:
    """Two stored settings to compare; storing also keeps the motion that is drawn."""

    def __init__(
        self,
        run: RunState,
        requests: Requests,
        set_active: Callable[[bool], Any],
        measures: Callable[[], dict[str, str]],
    ) -> None:
        self._run, self._requests, self._measures = run, requests, measures
        self._set_active = set_active
        self._stored: dict[str, Setting] = {}
        self._use: dict[str, ui.button] = {}
        with ui.row().classes("items-center gap-1"):
            for name in "AB":
                ui.button(f"Store {name}", on_click=partial(self._store, name)).props(
                    "outline dense"
                )
                use = ui.button(f"Use {name}", on_click=partial(self._apply, name))
                self._use[name] = use.props("outline dense")
                use.set_enabled(False)
            shown = ui.checkbox("overlay", value=True)
            shown.on_value_change(lambda event: call("showKept", event.value))
        self._refusal = refusal_label()
        self._table = table(what="setting", A="A", B="B", now="now")
        self._table.set_visibility(False)

    def refresh(self) -> None:
        """Show the settings side by side with what is there now."""
        for name, stored in self._stored.items():
            self._use[name].set_enabled(stored.units == self._run.units)
        sides = {**self._stored, "now": self._now()}
        rows = [
            {"what": what} | {side: setting.texts.get(what, "") for side, setting in sides.items()}
            for what in sides["now"].texts
        ]
        if self._stored and rows != self._table.rows:
            self._table.rows = rows

    def described(self) -> str:
        """Return the present parameters, and whether control is on, in words."""
        now = self._now()
        texts = (f"{what} {text}" for what, text in now.texts.items())
        return ", ".join(islice(texts, len(now.values) + 1))

    def _now(self) -> Setting:
        units = self._run.units
        known = {name: current(self._run, name) for name in main_parameters(self._run.law)}
        values = {name: value for name, value in known.items() if value is not None}
        texts = {
            name_of(name): units.text(value, described(name).unit or "")
            for name, value in values.items()
        }
        texts["control"] = "on" if self._run.control_on else "off"
        return Setting(values, self._run.control_on, units, texts | self._measures())

    def _store(self, name: str) -> None:
        self._stored[name] = self._now()
        self._table.set_visibility(True)
        call("keep", name)
        self.refresh()

    async def _apply(self, name: str) -> None:
        stored = self._stored[name]
        refusals: list[str] = []
        for full_name, value in stored.values.items():
            if current(self._run, full_name) != value:
                answer = self._requests.set_parameter(full_name, value)
                refusals.append(await asyncio.wrap_future(answer))
        if stored.active != self._run.control_on:
            await self._set_active(stored.active)
        self._refusal.set_text("; ".join(filter(None, refusals)))


def refusal_label() -> ui.label:
    """Return a label for the reason of a refusal, hidden while it is empty."""
    label = ui.label().classes("text-sm refusal").props("role=alert")
    return label.bind_visibility_from(label, "text")


@contextmanager
def refusals_in(label: ui.label) -> Generator[None]:
    """Show why an input is refused."""
    try:
        yield
    except InvalidInputError as error:
        label.set_text(str(error))


async def report(answer: Answer, refusal: ui.label) -> None:
    """Wait for an answer and show it if it is a refusal."""
    refusal.set_text(await asyncio.wrap_future(answer))


def _is_adjustable(parameter: Parameter) -> bool:
    return parameter.kind is float and parameter.changes is Changes.LIVE
