"""The ROS node of the dashboard: listens to a running loop and sends requests to its nodes."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.context import Context
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import ReliabilityPolicy, qos_profile_parameter_events
from rclpy.subscription import Subscription
from std_msgs.msg import Float64

from stickslip_ros.app.dashboard.run_requests import Impulse, Requests
from stickslip_ros.app.dashboard.run_state import CYCLES_KEPT, RunState
from stickslip_ros.nodes.base.clients import ParameterCalls
from stickslip_ros.nodes.base.endpoints import PollingNode, qos_profile, waiting_messages
from stickslip_ros.nodes.base.spinner import steady_clock
from stickslip_ros.nodes.running.controller_search import DASHBOARD
from stickslip_ros.record.codec import joint_state_columns, wrench_columns
from stickslip_ros.record.topics import (
    AMPLITUDE,
    CONTROL_FORCE,
    DIAGNOSTICS,
    DROPPED_FORCE,
    JOINT_STATES,
    Topic,
)
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.scenarios import full_name
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS


class ListenerNode(PollingNode):
    """Listens to states, forces sent and dropped, cycles, health and parameters of a namespace."""

    def __init__(
        self,
        run: RunState,
        show: Callable[[SampleColumns, ForceColumns, ForceColumns], None],
        *,
        context: Context | None = None,
    ) -> None:
        """Keep what is heard in `run`, and listen in its namespace.

        States, forces and dropped forces are passed to `show`, in blocks.
        """
        super().__init__(DASHBOARD, namespace=run.namespace, context=context)
        clock = steady_clock(self)
        self.run = run
        self.requests = Requests(self, run)
        self.impulse = Impulse(self, clock, run, self._take_samples)
        self._show = show
        self._parameter_calls = ParameterCalls(self, run.take_parameters)
        self._states = self._listen_loosely(JOINT_STATES)
        self._forces = self._listen_loosely(CONTROL_FORCE)
        self._dropped_forces = self._listen_loosely(DROPPED_FORCE)
        for topic in run.cycles:
            callback, qos = partial(self._on_cycle, topic), qos_profile(topic, CYCLES_KEPT)
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
        self._parameter_writers = 0
        self._ended = False
        self.create_timer(0.02, self._take_samples, clock=clock)
        self.create_timer(0.1, self._watch, clock=clock)

    @property
    def ended(self) -> bool:
        """Whether a run was heard whose plant and analyzer have left."""
        return self.run.newest > 0 and not any(
            topic.get_publisher_count() for topic in (self._states, self._amplitudes)
        )

    def close(self) -> None:
        """End a running impulse, and give up pending requests."""
        self.impulse.close()
        self.requests.close()

    def _listen_loosely(self, topic: Topic[Any]) -> Subscription:
        """Queue messages without acknowledging them, so that the writer has no extra work."""
        qos = qos_profile(topic, reliability=ReliabilityPolicy.BEST_EFFORT)
        return self.create_polled_subscription(topic, qos)

    def _take_samples(self) -> None:
        """Pass on the states and forces received."""
        had_ended, self._ended = self._ended, self.ended
        if had_ended and not self._ended:
            self.run.begin_run()
        states, _ = joint_state_columns(list(waiting_messages(self._states)))
        forces, _ = wrench_columns(list(waiting_messages(self._forces)))
        dropped, _ = wrench_columns(list(waiting_messages(self._dropped_forces)))
        if len(states.stamp):
            self.run.take_newest(int(states.stamp[-1]))
        if len(states.stamp) or len(forces.stamp) or len(dropped.stamp):
            self._show(states, forces, dropped)
        self.impulse.end_if_due()

    def _watch(self) -> None:
        """Continue pending requests; mark nodes that have become silent."""
        self.requests.pursue()
        self._parameter_calls.pursue()
        matched = self._parameter_events.get_publisher_count()
        if matched != self._parameter_writers:
            self._parameter_writers = matched
            self._parameter_calls.ask_again()  # earlier changes were not received
        self.run.mark_silent()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        here = full_name(self.get_namespace(), "")
        for status in message.status:
            node = status.name.removeprefix(here)
            changed = status.name.startswith(here) and self.run.take_status(node, status)
            if changed and node in NODE_PARAMETERS:
                self._parameter_calls.ask(node)

    def _on_parameter_event(self, event: ParameterEvent) -> None:
        here = full_name(self.get_namespace(), "")
        node = event.node.removeprefix(here)
        if event.node.startswith(here) and node in NODE_PARAMETERS:
            changed = (*event.new_parameters, *event.changed_parameters)
            values: dict[str, Any] = {}
            with suppress(RuntimeError):  # a type that ROS does not know
                values = {p.name: parameter_value_to_python(p.value) for p in changed}
            self.run.take_changes(node, values)
            if node in self._parameter_calls and not self._parameter_calls.has_answered(node):
                self._parameter_calls.ask(node)  # its answer may be outdated

    def _on_cycle(self, topic: Topic[Any], message: Float64) -> None:
        self.run.take_cycle(topic, message.data)
