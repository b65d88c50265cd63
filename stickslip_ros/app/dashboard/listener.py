"""The ROS node of the dashboard: listens to a running loop and calls services of its nodes."""

import re
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from math import isfinite
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterEvent
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import ReliabilityPolicy, qos_profile_parameter_events
from rclpy.timer import Timer
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.drive import Drive
from stickslip_ros.nodes.base.clients import (
    OnAnswer,
    ServiceCall,
    parameters_call,
    setting_call,
    transition_request,
)
from stickslip_ros.nodes.base.endpoints import PollingNode, qos_profile, waiting_messages
from stickslip_ros.nodes.base.managed import FIRST_STAMP, STATE
from stickslip_ros.nodes.base.spinner import steady_clock
from stickslip_ros.nodes.running.controller_search import DASHBOARD
from stickslip_ros.record.codec import joint_state_columns, pack_wrench, wrench_columns
from stickslip_ros.record.topics import (
    AMPLITUDE,
    CONTROL_FORCE,
    DIAGNOSTICS,
    DISTURBANCE_FORCE,
    DROPPED_FORCE,
    FREQUENCY,
    JOINT_STATES,
    STICK_FRACTION,
    Topic,
)
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.scenarios import full_name
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    DEFAULT_LAW,
    NODE_PARAMETERS,
    PlantParameters,
    controller_node,
)
from stickslip_ros.show.quantities import Units
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import number_in

SILENCE = 2.5
"""Time, s, without diagnostics (sent once per second) after which a node counts as silent."""

SILENT = "silent"
"""State of a node that has sent diagnostics before."""
ABSENT = "not found"
"""State of a node that has never sent diagnostics."""

LONGEST_TAP = 1e6
"""Longest duration of an impulse in simulated time, s."""

_LAWS = {controller_node(law): law for law in CONTROLLER_PARAMETERS}
"""Control law of each controller node."""

_ANSWER_TIMEOUT = 10.0
_CYCLES_KEPT = 200
_SILENCE = 0.5
"""Time without samples, s, after which a plant in lockstep waits for a reply."""

Answer = Future[str]
"""Result of a request: empty if it succeeded, otherwise a sentence with the reason."""


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


class ListenerNode(PollingNode):
    """Listen to states, forces sent and dropped, cycles and /diagnostics of a namespace.

    The received data may be read from any thread: mappings are replaced as a whole, deques must be
    copied. Requests may be made from any thread, too.
    """

    def __init__(
        self,
        namespace: str,
        show: Callable[[SampleColumns, ForceColumns, ForceColumns], None],
        readable: Collection[str] = (),
        *,
        context: Context | None = None,
    ) -> None:
        """Listen in a namespace; pass states, forces and dropped forces to `show`, in blocks.

        Of the paths that other nodes name, only those that are `readable` are read.
        """
        super().__init__(DASHBOARD, namespace=namespace, context=context)
        self._show = show
        self.readable = readable
        self.command = ""
        """Command that started the run; empty if it is not known."""
        self.health: Mapping[str, Health] = {node: Health() for node in ("analyzer", "plant")}
        """Health by the node's name relative to the namespace; controllers once heard."""
        self.law = DEFAULT_LAW
        """Control law of the controller that was heard, the default law until one is heard."""
        self.parameters: Mapping[str, Mapping[str, Any]] = {node: {} for node in NODE_PARAMETERS}
        """Current parameters by node and flat name, as far as they are known and allowed."""
        self._drive_of: tuple[Mapping[str, Any], Drive | None] = ({}, None)
        self.cycles: dict[Topic[Any], deque[float]] = {}
        """The measures of the last cycles by topic."""
        self.cycle_count = 0
        """Number of all cycles received."""
        self.events: deque[Event] = deque(maxlen=200)
        """Events, the newest last."""
        self.moved_at = 0.0
        """Time of the newest samples on the monotonic clock, s."""
        self._answering_since: float | None = None
        self._every = partial(self.create_timer, clock=steady_clock(self))
        self._calls: list[tuple[ServiceCall, float, Callable[[], None]]] = []
        self._asked_parameters: dict[str, ServiceCall] = {}
        self._parameter_writers = 0
        self.newest = 0
        """Stamp of the newest sample, ns; 0 before the first."""
        self._tap_end = 0
        self._tap_timer: Timer | None = None
        self._states = self._listen_loosely(JOINT_STATES)
        self._forces = self._listen_loosely(CONTROL_FORCE)
        self._dropped_forces = self._listen_loosely(DROPPED_FORCE)
        self._disturbance = self.create_publisher(
            WrenchStamped, DISTURBANCE_FORCE.name, qos_profile(DISTURBANCE_FORCE)
        )
        for topic in (AMPLITUDE, STICK_FRACTION, FREQUENCY):
            self.cycles[topic] = deque(maxlen=_CYCLES_KEPT)
            callback, qos = partial(self._on_cycle, topic), qos_profile(topic, _CYCLES_KEPT)
            subscription = self.create_subscription(Float64, topic.name, callback, qos)
            if topic is AMPLITUDE:
                self._amplitudes = subscription
        self.create_subscription(
            DiagnosticArray, DIAGNOSTICS.name, self._on_diagnostics, qos_profile(DIAGNOSTICS)
        )
        self._parameter_events = self.create_subscription(
            ParameterEvent,
            "/parameter_events",
            self._on_parameter_event,
            qos_profile_parameter_events,
        )
        self._every(0.02, self._take)
        self._every(0.1, self._watch)

    @property
    def controller(self) -> str:
        """Name of the controller relative to the namespace."""
        return controller_node(self.law)

    @property
    def drive(self) -> Drive | None:
        """The drive with its current parameters; None while they are unknown."""
        values = self.parameters["plant"]
        if values is not self._drive_of[0]:
            drive = None
            if values:
                with suppress(InvalidInputError):  # a plant of another version
                    drive = PlantParameters().changed(values, "plant").as_drive()
            self._drive_of = values, drive
        return self._drive_of[1]

    @property
    def units(self) -> Units:
        """The units in which its values are shown."""
        return Units.for_drive(self.drive)

    def time_of(self, stamp: int) -> float | None:
        """Return the simulated time since the plant was activated, s; None if it is not known."""
        first = number_in(self.health["plant"].figures.get(FIRST_STAMP, ""))
        return (stamp - first) / NANOSECONDS if 0 < first <= stamp else None

    @property
    def ended(self) -> bool:
        """Whether a run was heard whose plant and analyzer have left."""
        return self.newest > 0 and not any(
            topic.get_publisher_count() for topic in (self._states, self._amplitudes)
        )

    @property
    def acts_in(self) -> float:
        """Simulated time until the force of the active controller acts, s; 0 if it does."""
        delay = self.parameters[self.controller].get("start_after", 0.0)
        active = self.health.get(self.controller, Health()).state == "active"
        if not (delay and active) or self._answering_since is None:
            return 0.0
        return max(delay - (self.newest - self._answering_since) / NANOSECONDS, 0.0)

    @property
    def waits_for_reply(self) -> float:
        """Time that a plant in lockstep may still wait for a controller, s; 0 if it does not."""
        plant = self.parameters["plant"]
        still = time.monotonic() - self.moved_at
        waiting = self.moved_at and self.health["plant"].state == "active" and still > _SILENCE
        if not waiting or plant.get("pace") != "lockstep" or not plant.get("expects_control"):
            return 0.0
        return max((plant.get("reply_timeout") or 0.0) - still, 0.0)

    def set_parameter(self, node: str, name: str, value: Any) -> Answer:
        """Set a parameter of a node while it runs."""

        def outcome(response: Any) -> str:
            if response.result.successful:
                if response.result.reason:  # it has no effect yet
                    self._tell(response.result.reason)
                return ""
            self._tell(f"{node} refused: {response.result.reason}")
            return response.result.reason

        return self._request(node, partial(setting_call, self, node, {name: value}), outcome)

    def set_active(self, node: str, active: bool) -> Answer:
        """Activate or deactivate a managed (lifecycle) node."""
        state = "active" if active else "inactive"
        transition = Transition.TRANSITION_ACTIVATE if active else Transition.TRANSITION_DEACTIVATE

        def outcome(response: Any) -> str:
            # A node refuses the repeated request if it has obeyed the first, whose answer was lost.
            made = response.success or self.health.get(node, Health()).state == state
            return "" if made else f"{node} could not become {state}"

        def call(on_answer: OnAnswer) -> ServiceCall:
            longest = 8.0  # s, of a transition
            call = ServiceCall(self, ChangeState, f"{node}/change_state", answer_time=longest)
            return call.start(transition_request(transition), on_answer)

        return self._request(node, call, outcome)

    def reset(self) -> Answer:
        """Reset the motion to its initial state."""

        def outcome(response: Any) -> str:
            if not response.success:
                return response.message
            self._tell("reset to the initial state", "reset")
            return ""

        def call(on_answer: OnAnswer) -> ServiceCall:
            return ServiceCall(self, Trigger, "plant/reset").start(Trigger.Request(), on_answer)

        return self._request("plant", call, outcome)

    def tap(self, force: float, duration: float) -> Answer:
        """Apply an impulse to the slide: a force (N) for a simulated time (s)."""
        answer = Answer()
        if not (isfinite(force) and 0.0 < duration <= LONGEST_TAP):
            answer.set_result(
                f"an impulse needs a finite force and a duration above 0, at most {LONGEST_TAP:g} s"
            )
            return answer

        def begin() -> None:
            if not self._disturbance.get_subscription_count():
                _settle(answer, f"no node subscribes to {self._disturbance.topic_name}")
                return
            self._take()
            self._disturbance.publish(pack_wrench(self.newest, force))
            self._tap_end = self.newest + round(duration * NANOSECONDS)
            push, lasting = self.units.text(force, "N"), self.units.text(duration, "s")
            self._tell(f"impulse of {push} for {lasting}", push)
            if self._tap_timer is None:
                self._tap_timer = self._every(0.002, self._take)
            _settle(answer, "")

        self._call_soon(begin)
        return answer

    def close(self) -> None:
        """End a running impulse, and give up pending requests."""
        if self._tap_timer is not None:
            self._end_tap()
            self._disturbance.wait_for_all_acked(Duration(seconds=1.0))
        for call, _, give_up in self._calls:
            call.close()
            give_up()
        self._calls.clear()

    def _listen_loosely(self, topic: Topic[Any]) -> Any:
        """Queue messages without acknowledging them, so that the writer has no extra work."""
        qos = qos_profile(topic)
        qos.reliability = ReliabilityPolicy.BEST_EFFORT
        return self.create_polled_subscription(topic, qos)

    def _call_soon(self, callback: Callable[[], None]) -> None:
        def call() -> None:
            try:
                callback()
            except Exception as error:  # the executor would end the process silently
                self.get_logger().error(f"{type(error).__name__}: {error}")

        if self.executor is not None:
            self.executor.create_task(call)

    def _request(
        self, node: str, call: Callable[[OnAnswer], ServiceCall], outcome: Callable[[Any], str]
    ) -> Answer:
        """Start a call of a service of a node; `outcome` turns its response into the answer."""
        answer = Answer()

        def ask() -> None:
            started = call(lambda response: _settle(answer, outcome(response)))
            started.pursue()
            give_up = partial(_settle, answer, f"{node} does not answer")
            self._calls.append((started, time.monotonic() + _ANSWER_TIMEOUT, give_up))

        self._call_soon(ask)
        return answer

    def _take(self) -> None:
        """Pass on the messages received."""
        states, _ = joint_state_columns(list(waiting_messages(self._states)))
        forces, _ = wrench_columns(list(waiting_messages(self._forces)))
        dropped, _ = wrench_columns(list(waiting_messages(self._dropped_forces)))
        if len(states.stamp):
            self.newest = int(states.stamp[-1])
            self.moved_at = time.monotonic()
        if len(states.stamp) or len(forces.stamp) or len(dropped.stamp):
            self._show(states, forces, dropped)
        if self._tap_timer is not None and self.newest >= self._tap_end:
            self._end_tap()

    def _end_tap(self) -> None:
        self._disturbance.publish(pack_wrench(self.newest, 0.0))
        self._tell("the impulse has ended")
        if self._tap_timer is not None:
            self.destroy_timer(self._tap_timer)
            self._tap_timer = None

    def _watch(self) -> None:
        """Continue pending requests; mark nodes that have become silent."""
        now = time.monotonic()
        for entry in list(self._calls):
            call, deadline, give_up = entry
            if call.pursue() or now > deadline:
                give_up()
                call.close()
                self._calls.remove(entry)
        for call in self._asked_parameters.values():
            call.pursue()
        matched = self._parameter_events.get_publisher_count()
        if matched != self._parameter_writers:
            self._parameter_writers = matched
            for node in self._asked_parameters:  # earlier changes were not received
                self._ask_parameters(node)
        for node, health in self.health.items():
            if health.heard_at and health.state != SILENT and now - health.heard_at > SILENCE:
                self._update(node, Health(SILENT, 2, "", health.figures, health.heard_at))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        here = full_name(self.get_namespace(), "")
        for status in message.status:
            if status.name.startswith(here):
                self._on_status(status.name.removeprefix(here), status)

    def _on_status(self, node: str, status: DiagnosticStatus) -> None:
        figures = {entry.key: entry.value for entry in status.values}
        state = figures.pop(STATE, "")
        message = status.message if status.message != state else ""
        before = self.health.get(node)
        if before is None and len(self.health) >= 50:  # any participant may publish any name
            return
        before = before or Health()
        if node in _LAWS and self.health.get(self.controller, Health()).state in (ABSENT, SILENT):
            self.law = _LAWS[node]
        restarted = state == before.state and _has_restarted(before.figures, figures)
        if restarted:
            self._tell(f"{node} restarted")
        self._update(node, Health(state, status.level[0], message, figures, time.monotonic()))
        if node == self.controller:
            rate, answered = self.parameters["plant"].get("rate"), figures.get("answered")
            self._answering_since = None
            if rate and answered:
                self._answering_since = self.newest - number_in(answered) / rate * NANOSECONDS
        if node in NODE_PARAMETERS and (restarted or state != before.state):
            self._ask_parameters(node)  # it may be another node of the same name

    def _tell(self, text: str, mark: str = "") -> None:
        self.events.append(Event(time.time(), text, mark, self.newest))

    def _update(self, node: str, health: Health) -> None:
        before = self.health.get(node, Health())
        self.health = {**self.health, node: health}
        if health.state != before.state:
            back = "is back, " if before.state == SILENT else ""
            mark = ""
            if node in _LAWS and before.state != ABSENT:
                mark = {"active": "control on", "inactive": "control off"}.get(health.state, "")
            self._tell(f"{node} {back}{health.state or 'heard'}", mark)
        if health.message and _wording(health.message) != _wording(before.message):
            self._tell(f"{node}: {health.message}")

    def _ask_parameters(self, node: str) -> None:
        names = list(NODE_PARAMETERS[node].known)
        if node in self._asked_parameters:
            self._asked_parameters[node].close()
        self._asked_parameters[node] = parameters_call(self, node, names, partial(self._know, node))

    def _know(self, node: str, values: Mapping[str, Any]) -> None:
        known = {**self.parameters[node], **self._allowed(node, values)}
        self.parameters = {**self.parameters, node: known}

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

    def _on_parameter_event(self, event: ParameterEvent) -> None:
        here = full_name(self.get_namespace(), "")
        node = event.node.removeprefix(here)
        if event.node.startswith(here) and node in self.parameters:
            changed = (*event.new_parameters, *event.changed_parameters)
            values: dict[str, Any] = {}
            with suppress(RuntimeError):  # a type that ROS does not know
                values = {p.name: parameter_value_to_python(p.value) for p in changed}
            for name, value in self._allowed(node, values).items():
                before = self.parameters[node].get(name)
                # Nodes that end take their parameters back. A NaN differs from itself.
                if None not in (before, value) and repr(before) != repr(value):
                    unit = NODE_PARAMETERS[node].known[name].unit or ""
                    old, text = (self.units.text(each, unit) for each in (before, value))
                    self._tell(f"{node}.{name}: {old} to {text}", f"{name} {text}")
            if self.parameters[node]:  # otherwise only these would be known
                self._know(node, values)
            asked = self._asked_parameters.get(node)
            if asked is not None and asked.answer is None:  # its answer may be outdated
                self._ask_parameters(node)

    def _on_cycle(self, topic: Topic[Any], message: Float64) -> None:
        self.cycles[topic].append(message.data)
        if topic is AMPLITUDE:
            self.cycle_count += 1


def _settle(answer: Answer, result: str) -> None:
    """Set the answer unless it is already set or cancelled."""
    if not answer.done():
        answer.set_result(result)


def _wording(message: str) -> str:
    """Return a message without its numbers, which change all the time."""
    return re.sub(r"[\d.]+", "", message)


def _has_restarted(before: Mapping[str, str], figures: Mapping[str, str]) -> bool:
    """Return whether a counter of a node has started again from 0."""
    return any(
        count in figures and number_in(figures[count]) < number_in(before.get(count, ""))
        for count in ("samples", "answered")
    )
