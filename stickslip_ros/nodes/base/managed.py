"""Base class of the nodes: life cycle, topics, diagnostics."""

import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from math import inf
from typing import Any, TypeAlias, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.duration import Duration
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer

from stickslip_ros.errors import BagError, InvalidInputError, StickslipError
from stickslip_ros.nodes.base.endpoints import (
    KeepingNode,
    matching_ends,
    message_class,
    qos_profile,
)
from stickslip_ros.nodes.base.parameters import ParameterNode, ParametersT, first_line
from stickslip_ros.nodes.base.scheduling import schedule_process
from stickslip_ros.nodes.base.spinner import steady_clock
from stickslip_ros.record.topics import DIAGNOSTICS, RECORDED, Topic
from stickslip_ros.scenarios import full_name

Transition: TypeAlias = Any
"""A `TransitionCallbackReturn`, which is compiled and has no types."""

MessageT = TypeVar("MessageT")

Level = bytes
OK: Level = DiagnosticStatus.OK
WARN: Level = DiagnosticStatus.WARN
ERROR: Level = DiagnosticStatus.ERROR

Diagnosis = tuple[Level, str, dict[str, Any]]
"""Level, message and values of a node's diagnostics."""

STATE = "state"
"""Key of a node's life-cycle state in its diagnostics."""
FIRST_STAMP = "first_stamp"
"""Key of the stamp of the plant's first sample since its last activation, ns."""
NEWEST_STAMP = "newest_stamp"
"""Key of the stamp of the plant's newest sample, ns."""
FORECAST = "forecast"
"""Key of the plant's forecast of which forces will be late."""
FAILURE = "failure"
"""Key of the reason why the plant, or the recording, could not continue, if it could not."""
REFUSAL = "refusal"
"""Key of the reason why the last transition of a node has failed."""
WAITING = "waiting"
"""Key of what a node waits for before it becomes active, if it does."""
FINISHED = "finished"
"""Key of whether the plant has paused by itself, not on request."""

_DIAGNOSTICS_PERIOD = 1.0


def diagnosis(complaints: Iterable[str], values: dict[str, Any]) -> Diagnosis:
    """Return the diagnosis of a working node: a warning if there is a complaint, else OK."""
    complaint = "; ".join(filter(None, complaints))
    return WARN if complaint else OK, complaint, values


class DroppedMessages:
    """Counts dropped messages and keeps the last reason, which is a complaint for 15 s."""

    def __init__(self, logger: RcutilsLogger) -> None:
        """Start counting; the first message dropped after a pause is logged."""
        self._logger = logger
        self._number = 0
        self._last = ""
        self._complaint_ends = -inf

    def add(self, reason: str, number: int = 1) -> None:
        """Count `number` dropped messages; `reason` is a sentence about the last of them."""
        now = time.monotonic()
        if now > self._complaint_ends:
            self._logger.warning(reason)
        self._number += number
        self._last = reason
        self._complaint_ends = now + 15.0

    @property
    def complaint(self) -> str:
        """Current complaint; empty if there is none."""
        if time.monotonic() > self._complaint_ends:
            return ""
        return f"{self._number} messages dropped so far, the last: {self._last}"

    @property
    def values(self) -> dict[str, Any]:
        """Number and last reason, for the diagnostics."""
        return {"dropped_messages": self._number, "last_dropped": self._last or "none"}


class ManagedNode(KeepingNode, ParameterNode[ParametersT], ABC):
    """A managed (lifecycle) node whose parameters are one group.

    A subclass defines in `connect`, and optionally in `start` and `stop`, what it does when it is
    configured, activated and deactivated. An exception there is logged, and the transition fails.
    `defaults` are the parameters at their defaults; the options are those of `ParameterNode`.
    """

    def __init__(self, name: str, defaults: ParametersT, **options: Any) -> None:
        """Make the node; see the class."""
        super().__init__(name, defaults, **options)
        self.stopped = Future()
        """Done when the node's process may end; its result is the error that caused it, or None."""
        self.steady_clock = steady_clock(self)
        """Wall time, independent of simulated time."""
        self.dropped = DroppedMessages(self.get_logger())
        """Messages that the node has dropped since it was activated."""
        self.read_last: Publisher | None = None
        """Publisher whose topic recorders subscribe to last; None if they read only one."""
        self._refusal = self._missing = ""
        for service in self.services:  # those of rclpy
            service.callback = partial(_answered, self.get_logger(), service.callback)
        self._diagnostics = self.create_publisher(
            DiagnosticArray, DIAGNOSTICS.name, qos_profile(DIAGNOSTICS)
        )
        self.every(_DIAGNOSTICS_PERIOD, self.publish_diagnostics)
        self._autostart_timer: Timer | None = None
        if self.parameters.autostart:
            self._autostart_timer = self.every(0.05, self._autostart)

    @abstractmethod
    def connect(self) -> None:
        """Create publishers and subscriptions, and do slow preparations (configure)."""

    def start(self) -> None:
        """Start to work (activate)."""

    def stop(self) -> None:
        """Stop working (deactivate) once the messages sent have arrived."""
        for publisher in self.kept:
            if isinstance(publisher, Publisher):
                publisher.wait_for_all_acked(Duration(seconds=1))

    def diagnose(self) -> Diagnosis:
        """Return the node's health; by default based on dropped messages."""
        if not self.active:
            return OK, "", {}
        return diagnosis([self.dropped.complaint], self.dropped.values)

    def publishing_nodes(self) -> set[str]:
        """Return the names of nodes that publish what this node needs; its readers are known."""
        return set()

    def every(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call back at a fixed period of wall time, s."""
        return self.create_timer(period, callback, clock=self.steady_clock)

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Call back from the executor, after its pending work. Any thread may call this."""
        if self.executor is not None:
            self.executor.create_task(callback)

    def subscribe(
        self,
        topic: Topic[MessageT],
        callback: Callable[[MessageT], None],
        *,
        depth: int | None = None,
        while_active: bool = True,
    ) -> Subscription:
        """Pass the decoded messages of a topic to `callback` until the node is cleaned up.

        It receives the ROS messages of a topic without a decoder. A message counts as dropped if it
        cannot be decoded, or `callback` raises BagError. The length of the queue, `depth`, is by
        default that of the topic. With `while_active`, messages are ignored while the node is not
        active.
        """
        decode = topic.decode or partial(
            deserialize_message, message_type=message_class(topic.type_name)
        )

        def take(message: bytes) -> None:
            if while_active and not self.active:
                return
            try:
                callback(decode(message))
            except BagError as error:
                self.dropped.add(f"{topic.name.replace('_', ' ')}: {error}")

        return self.subscribe_serialized(topic, take, depth)

    def publish_diagnostics(self) -> None:
        """Publish the node's health."""
        level, message, values = self.diagnose()
        if self._refusal:
            level, message, values = ERROR, self._refusal, {**values, REFUSAL: self._refusal}
        if self._missing:
            values = {**values, WAITING: self._missing}
        status = DiagnosticStatus(
            level=level,
            name=self.get_fully_qualified_name(),
            hardware_id=self.get_namespace().strip("/"),
            message=message or self.lifecycle_state,
            values=[
                KeyValue(key=key, value=str(value))
                for key, value in {STATE: self.lifecycle_state, **values}.items()
            ],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def duplicate_publishers(self, *topics: Topic[Any]) -> list[str]:
        """Return a sentence for each topic with several publishers, with the names of their nodes.

        A killed publisher counts until its lease in the middleware ends.
        """
        sentences: list[str] = []
        for topic in topics:
            name = self.resolve_topic_name(topic.name)
            nodes = Counter(
                full_name(publisher.node_namespace, publisher.node_name)
                for publisher in self.get_publishers_info_by_topic(name)
                if publisher.topic_type == topic.type_name
            )
            if nodes.total() > 1:
                names = (f"{node} ({n} times)" if n > 1 else node for node, n in nodes.items())
                sentences.append(
                    f"{nodes.total()} publishers of {name}: {', '.join(sorted(names))}"
                )
        return sentences

    def end_process(self, reason: StickslipError | None) -> None:
        """End the process of the node; `reason` is the error that causes this, or None."""
        if not self.stopped.done():
            self.stopped.set_result(reason)

    def on_configure(self, state: LifecycleState) -> Transition:
        """Connect."""
        self._missing = ""
        return self._transition(self.connect, "configured")

    def on_activate(self, state: LifecycleState) -> Transition:
        """Start, if the nodes in wait_for are connected."""
        if self._is_waiting():
            return TransitionCallbackReturn.FAILURE
        self.dropped = DroppedMessages(self.get_logger())
        for refusal in schedule_process(self.parameters):
            self.get_logger().warning(refusal)
        result = self._transition(self.start, "active")
        self.active = result is TransitionCallbackReturn.SUCCESS
        return result

    def on_deactivate(self, state: LifecycleState) -> Transition:
        """Stop."""
        return self._transition(self._stop_and_tell, "paused")

    def on_cleanup(self, state: LifecycleState) -> Transition:
        """Disconnect."""
        return self._transition(self.release_all, "cleaned up")

    def on_shutdown(self, state: LifecycleState) -> Transition:
        """Stop if need be, and disconnect."""
        if self.active:
            self._transition(self._stop_and_tell)
        return self._transition(self.release_all)

    def on_error(self, state: LifecycleState) -> Transition:
        """Disconnect, to start again."""
        return self._transition(self.release_all)

    def _stop_and_tell(self) -> None:
        try:
            self.stop()
            self.publish_diagnostics()
        finally:
            self.active = False

    def _transition(self, action: Callable[[], None], done: str = "") -> Transition:
        """Run the action of a transition, and log the new state."""
        try:
            action()
        except InvalidInputError as error:
            if self._autostart_timer is not None:
                self.end_process(error)
            elif str(error) != self._refusal:  # the request may be repeated many times
                self.get_logger().error(str(error))
            self._refusal = str(error)
            self.publish_diagnostics()  # the answer to the request does not tell it
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # rclpy would ignore it silently
            self._refusal = f"{type(error).__name__}: {error}"
            self.get_logger().error(self._refusal)
            self._end_autostart()
            return TransitionCallbackReturn.ERROR
        if done:
            self._refusal = ""
            self.get_logger().info(done)
        return TransitionCallbackReturn.SUCCESS

    def _is_waiting(self) -> bool:
        """Return whether a node is missing; log its name, once until this node is active."""
        before, self._missing = self._missing, self.missing_peers()
        if self._missing and not before:
            whom = " for " + ", ".join(self.parameters.wait_for) if self.parameters.wait_for else ""
            self.get_logger().info(f"waiting{whom}: {self._missing}")
        return bool(self._missing)

    def _autostart(self) -> None:
        """Configure, then try to activate until the nodes in wait_for are connected."""
        if not self.configured:
            self.trigger_configure()
        # In the same step, if no node is missing: a plant expects a connected node to answer.
        if self.lifecycle_state == "inactive" and not self._is_waiting():
            self.trigger_activate()
        if self.active or self.stopped.done():
            self._end_autostart()

    def _end_autostart(self) -> None:
        if self._autostart_timer is not None:
            self._autostart_timer.cancel()
            self._autostart_timer = None

    def missing_peers(self) -> str:
        """Return what is missing of the nodes in wait_for, or an empty string.

        A node is found by any topic that it reads. Of a recorder, which reads several, the readers
        become known in the order in which it subscribes: it is found by the last one.
        """
        waiting_for = {name.rsplit("/", 1)[-1] for name in self.parameters.wait_for}
        if not waiting_for:
            return ""
        peers = self.publishing_nodes()
        recorders = {
            writer.node_name for writer in self.get_publishers_info_by_topic(RECORDED.name)
        }
        for end in self.kept:
            if isinstance(end, Publisher):
                readers = matching_ends(self, end)
                known = {reader.node_name for reader in readers}
                peers |= known if self.read_last in (None, end) else known - recorders
                matched = end.get_subscription_count() >= len(readers)
            elif isinstance(end, Subscription):
                matched = end.get_publisher_count() >= len(matching_ends(self, end))
            else:
                continue
            if not matched:
                return f"{end.topic_name} is not yet matched"
        absent = waiting_for - peers
        return f"missing: {', '.join(sorted(absent))}" if absent else ""


def _answered(
    logger: RcutilsLogger, callback: Callable[[Any, Any], Any], request: Any, response: Any
) -> Any:
    """Answer also a request that rclpy cannot serve, such as a transition from another state.

    After an exception it would answer neither this request nor, until more come, later ones.
    """
    try:
        return callback(request, response)
    except Exception as error:
        logger.error(f"a request is refused: {first_line(error)}")
        return response
