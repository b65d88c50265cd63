"""What the dashboard knows of a run, from what its nodes tell; no ROS graph."""

import re
import time
from collections import deque
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.drive import Drive
from stickslip_ros.nodes.base.managed import FIRST_STAMP, STATE
from stickslip_ros.record.topics import AMPLITUDE, FREQUENCY, STICK_FRACTION, Topic
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    DEFAULT_LAW,
    NODE_PARAMETERS,
    controller_node,
)
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.show.live_trace import LiveTrace
from stickslip_ros.show.quantities import Units
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import number_in

SILENCE = 2.5
"""Time, s, without diagnostics (sent once per second) after which a node counts as silent."""

SILENT = "silent"
"""State of a node that has sent diagnostics before."""
ABSENT = "not found"
"""State of a node that has never sent diagnostics."""

CYCLES_KEPT = 200
_MOST_NODES = 50
_LAWS = {controller_node(law): law for law in CONTROLLER_PARAMETERS}
"""Control law of each controller node."""
_SILENCE = 0.5
"""Time without samples, s, after which a plant in lockstep waits for a reply."""


@dataclass(frozen=True)
class Health:
    """The last diagnostics of a node."""

    state: str = ABSENT
    """Life cycle state, or `SILENT` or `ABSENT`."""
    level: int = 0
    """0 OK, 1 warning, 2 error, as in DiagnosticStatus."""
    message: str = ""
    figures: Mapping[str, str] = field(default_factory=dict)
    heard_at: float = 0.0
    """Time of the diagnostics on the monotonic clock, s."""


class Event(NamedTuple):
    """Something that happened in a run."""

    when: float
    """s since the epoch."""
    text: str
    mark: str = ""
    """Short text for a mark in the time plots; empty: no mark."""
    stamp: int = 0
    """Stamp of the newest sample then, ns."""


class RunState:
    """Health, parameters, cycles and events of the run in a namespace.

    They may be read from any thread: mappings are replaced as a whole, deques must be copied.
    """

    def __init__(self, namespace: str, readable: Collection[str] = (), command: str = "") -> None:
        """Know nothing yet; see the attributes."""
        self.namespace = namespace
        self.readable = readable
        """Of the paths that nodes name, those that may be read."""
        self.command = command
        """Command that started the run; empty if it is not known."""
        self.health: Mapping[str, Health] = {node: Health() for node in ("analyzer", "plant")}
        """Health by the node's name relative to the namespace; controllers once heard."""
        self.law = DEFAULT_LAW
        """Control law of the controller that was heard, the default law until one is heard."""
        self.parameters: Mapping[str, Mapping[str, Any]] = {node: {} for node in NODE_PARAMETERS}
        """Current parameters by node and flat name, as far as they are known and allowed."""
        self.events: deque[Event] = deque(maxlen=200)
        """Events, the newest last."""
        self.begin_run()
        self._moved_at = 0.0
        """Time of the newest samples on the monotonic clock, s."""
        self._answering_since: float | None = None
        """Stamp of the sample that the controller answered first, ns."""
        self._known_drive: tuple[Mapping[str, Any], Drive | None] = ({}, None)

    def begin_run(self) -> None:
        """Forget the controllers, the motion and the cycles of the run before."""
        self.health = {node: self.health[node] for node in ("analyzer", "plant")}
        self.trace = LiveTrace(0.0)
        """The last samples."""
        self.cycles: Mapping[Topic[Any], deque[float]] = {
            topic: deque(maxlen=CYCLES_KEPT) for topic in (AMPLITUDE, STICK_FRACTION, FREQUENCY)
        }
        """The measures of the last cycles by topic."""
        self.cycle_count = 0
        """Number of all cycles received."""
        self.newest = 0
        """Stamp of the newest sample, ns; 0 before the first."""
        # Stamps of another run may be those of samples to come.
        events = [event._replace(mark="", stamp=0) for event in self.events]
        self.events = deque(events, self.events.maxlen)

    @property
    def controller(self) -> str:
        """Name of the controller relative to the namespace."""
        return controller_node(self.law)

    @property
    def controller_state(self) -> str:
        """State of the controller as in its `Health`."""
        return self.health.get(self.controller, Health()).state

    @property
    def control_on(self) -> bool:
        """Whether the controller is active."""
        return self.controller_state == "active"

    @property
    def drive(self) -> Drive | None:
        """The drive with its current parameters; None while they are unknown."""
        values = self.parameters["plant"]
        if values is not self._known_drive[0]:
            drive = None
            if values:
                with suppress(InvalidInputError):  # a plant of another version
                    drive = PlantParameters().changed(values, "plant").as_drive()
            self._known_drive = values, drive
        return self._known_drive[1]

    @property
    def units(self) -> Units:
        """The units in which its values are shown."""
        return Units.for_drive(self.drive)

    @property
    def acts_in(self) -> float:
        """Simulated time until the force of the active controller acts, s; 0 if it does."""
        delay = self.parameters[self.controller].get("start_after", 0.0)
        if not (delay and self.control_on) or self._answering_since is None:
            return 0.0
        return max(delay - (self.newest - self._answering_since) / NANOSECONDS, 0.0)

    @property
    def waits_for_reply(self) -> float:
        """Time that a plant in lockstep may still wait for a controller, s; 0 if it does not."""
        plant = self.parameters["plant"]
        still = time.monotonic() - self._moved_at
        waiting = self._moved_at and self.health["plant"].state == "active" and still > _SILENCE
        if not waiting or plant.get("pace") != "lockstep" or not plant.get("expects_control"):
            return 0.0
        return max((plant.get("reply_timeout") or 0.0) - still, 0.0)

    def time_of(self, stamp: float) -> float | None:
        """Return the simulated time since the plant was activated, s; None if it is not known."""
        first = number_in(self.health["plant"].figures.get(FIRST_STAMP, ""))
        return (stamp - first) / NANOSECONDS if 0 < first <= stamp else None

    def add_event(self, text: str, mark: str = "") -> None:
        """Add an event of now."""
        self.events.append(Event(time.time(), text, mark, self.newest))

    def take_newest(self, stamp: int) -> None:
        """Take the stamp of the newest sample (ns), which has come now."""
        self.newest, self._moved_at = stamp, time.monotonic()

    def take_cycle(self, topic: Topic[Any], value: float) -> None:
        """Take a measure of a cycle."""
        self.cycles[topic].append(value)
        if topic is AMPLITUDE:
            self.cycle_count += 1

    def take_status(self, node: str, status: DiagnosticStatus) -> bool:
        """Take the diagnostics of a node; return whether its parameters may be others now."""
        figures = {entry.key: entry.value for entry in status.values}
        state = figures.pop(STATE, "")
        message = status.message if status.message != state else ""
        if node not in self.health and len(self.health) >= _MOST_NODES:
            return False  # any participant may publish any name
        before = self.health.get(node, Health())
        if node in _LAWS and self.controller_state in (ABSENT, SILENT):
            self.law = _LAWS[node]
        restarted = state == before.state and _has_restarted(before.figures, figures)
        if restarted:
            self.add_event(f"{node} restarted")
        self._update(node, Health(state, status.level[0], message, figures, time.monotonic()))
        if node == self.controller:
            plant, answered = self.parameters["plant"], figures.get("answered")
            rate = plant.get("rate", 0.0) / plant.get("answer_every", 1)
            self._answering_since = None
            if rate and answered:
                self._answering_since = self.newest - number_in(answered) / rate * NANOSECONDS
        return restarted or state != before.state  # it may be another node of the same name

    def mark_silent(self) -> None:
        """Mark the nodes that have become silent."""
        for node, health in self.health.items():
            silence = time.monotonic() - health.heard_at
            if health.heard_at and health.state != SILENT and silence > SILENCE:
                error = health.message if health.level == 2 else ""  # why a run has ended, perhaps
                self._update(node, Health(SILENT, 2, error, health.figures, health.heard_at))

    def take_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        """Take parameters of a node, by flat name."""
        known = {**self.parameters[node], **self._allowed(node, values)}
        self.parameters = {**self.parameters, node: known}

    def take_changes(self, node: str, values: Mapping[str, Any]) -> None:
        """Take parameters of a node that have changed while it runs."""
        for name, value in self._allowed(node, values).items():
            before = self.parameters[node].get(name)
            # Nodes that end take their parameters back. A NaN differs from itself.
            if None not in (before, value) and repr(before) != repr(value):
                unit = NODE_PARAMETERS[node].known[name].unit or ""
                old, new = self.units.text(before, unit), self.units.text(value, unit)
                self.add_event(f"{node}.{name}: {old} to {new}", f"{name} {new}")
        if self.parameters[node]:  # otherwise only these would be known
            self.take_parameters(node, values)

    def _update(self, node: str, health: Health) -> None:
        before = self.health.get(node, Health())
        self.health = {**self.health, node: health}
        if health.state != before.state:
            back = "is back, " if before.state == SILENT else ""
            mark = ""
            if node in _LAWS and before.state != ABSENT:
                mark = {"active": "control on", "inactive": "control off"}.get(health.state, "")
            self.add_event(f"{node} {back}{health.state or 'heard'}", mark)
        if health.message and _wording(health.message) != _wording(before.message):
            self.add_event(f"{node}: {health.message}")

    def _allowed(self, node: str, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of known parameters; None for what a node of ours never has."""
        model = NODE_PARAMETERS[node]
        known = model.known
        allowed: dict[str, Any] = dict.fromkeys(name for name in values if name in known)
        for name in allowed:
            if not known[name].file or values[name] in ("", *self.readable):
                with suppress(InvalidInputError):
                    model.check_bounds(name, values[name])
                    allowed[name] = values[name]
        return allowed


def _wording(message: str) -> str:
    """Return a message without its numbers, which change all the time."""
    return re.sub(r"[\d.]+", "", message)


def _has_restarted(before: Mapping[str, str], figures: Mapping[str, str]) -> bool:
    """Return whether a counter of a node has started again from 0."""
    return any(
        count in figures and number_in(figures[count]) < number_in(before.get(count, ""))
        for count in ("samples", "answered")
    )
