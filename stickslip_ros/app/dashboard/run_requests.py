"""Requests of the page to the nodes of a run; each has an answer. Any thread may make them."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from math import isfinite
from typing import Any, NamedTuple

from geometry_msgs.msg import WrenchStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from stickslip_ros.app.dashboard.run_state import Health, RunState
from stickslip_ros.nodes.base.clients import OnAnswer, ServiceCall, setting_call, transition_request
from stickslip_ros.nodes.base.endpoints import PollingNode, qos_profile, waiting_messages
from stickslip_ros.record.codec import pack_wrench, wrench_columns
from stickslip_ros.record.topics import APPLIED_DISTURBANCE, DISTURBANCE_FORCE
from stickslip_ros.stamps import NANOSECONDS

LONGEST_IMPULSE = 1e6
"""Longest duration of an impulse in simulated time, s."""

_ANSWER_TIMEOUT = 10.0
_LATEST_START = 1.0
"""Simulated time, s, after which an impulse has begun, even if the plant does not say so."""

Answer = Future[str]
"""Result of a request: empty if it succeeded, otherwise a sentence with the reason."""


class _Pending(NamedTuple):
    call: ServiceCall
    deadline: float
    give_up: Callable[[], None]


class Requests:
    """Calls services of the nodes of a run."""

    def __init__(self, node: Node, run: RunState) -> None:
        """Call through a node; what happens is an event of the `run`."""
        self._node, self._run = node, run
        self._pending: list[_Pending] = []

    def set_parameter(self, full_name: str, value: Any) -> Answer:
        """Set NODE.PARAMETER while the node runs."""
        node, _, name = full_name.partition(".")

        def outcome(response: Any) -> str:
            if response.result.successful:
                if response.result.reason:  # it has no effect yet
                    self._run.add_event(response.result.reason)
                return ""
            self._run.add_event(f"{node} refused: {response.result.reason}")
            return response.result.reason

        return self._request(node, partial(setting_call, self._node, node, {name: value}), outcome)

    def set_active(self, node: str, active: bool) -> Answer:
        """Activate or deactivate a managed (lifecycle) node."""
        state = "active" if active else "inactive"
        transition = Transition.TRANSITION_ACTIVATE if active else Transition.TRANSITION_DEACTIVATE

        def outcome(response: Any) -> str:
            # A node refuses the repeated request if it has obeyed the first, whose answer was lost.
            made = response.success or self._run.health.get(node, Health()).state == state
            return "" if made else f"{node} could not become {state}"

        def call(on_answer: OnAnswer) -> ServiceCall:
            longest = 8.0  # s, of a transition
            service = f"{node}/change_state"
            call = ServiceCall(self._node, ChangeState, service, answer_time=longest)
            return call.start(transition_request(transition), on_answer)

        return self._request(node, call, outcome)

    def reset(self) -> Answer:
        """Reset the motion to its initial state."""

        def outcome(response: Any) -> str:
            if not response.success:
                return response.message
            self._run.add_event("reset to the initial state", "reset")
            return ""

        def call(on_answer: OnAnswer) -> ServiceCall:
            reset = ServiceCall(self._node, Trigger, "plant/reset")
            return reset.start(Trigger.Request(), on_answer)

        return self._request("plant", call, outcome)

    def pursue(self) -> None:
        """Do the next step of pending requests; call this repeatedly."""
        now = time.monotonic()
        for pending in list(self._pending):
            if pending.call.pursue() or now > pending.deadline:
                pending.give_up()
                pending.call.close()
                self._pending.remove(pending)

    def close(self) -> None:
        """Give up pending requests."""
        for pending in self._pending:
            pending.call.close()
            pending.give_up()
        self._pending.clear()

    def _request(
        self, node: str, call: Callable[[OnAnswer], ServiceCall], outcome: Callable[[Any], str]
    ) -> Answer:
        """Start a call of a service of a node; `outcome` turns its response into the answer."""
        answer = Answer()

        def ask() -> None:
            started = call(lambda response: _settle(answer, outcome(response)))
            started.pursue()
            give_up = partial(_settle, answer, f"{node} does not answer")
            self._pending.append(_Pending(started, time.monotonic() + _ANSWER_TIMEOUT, give_up))

        _call_soon(self._node, ask)
        return answer


class Impulse:
    """A force on the slide for a simulated time."""

    def __init__(
        self, node: PollingNode, clock: Clock, run: RunState, take_samples: Callable[[], None]
    ) -> None:
        """Publish through a node with a steady clock; `take_samples` brings `run` up to date."""
        self._node, self._clock, self._run = node, clock, run
        self._take_samples = take_samples
        self._force = node.create_publisher(
            WrenchStamped, DISTURBANCE_FORCE.name, qos_profile(DISTURBANCE_FORCE)
        )
        qos = qos_profile(APPLIED_DISTURBANCE, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._applied = node.create_polled_subscription(APPLIED_DISTURBANCE, qos)
        self._asked = self._duration = self._end = 0
        """Newest stamp when it was asked for, duration, and stamp at which the force ends, ns."""
        self._timer: Timer | None = None

    def apply(self, force: float, duration: float) -> Answer:
        """Apply a force (N) for a simulated time (s)."""
        answer = Answer()
        if not (isfinite(force) and 0.0 < duration <= LONGEST_IMPULSE):
            answer.set_result(
                "an impulse needs a finite force and a duration above 0, at most "
                f"{LONGEST_IMPULSE:g} s"
            )
            return answer

        def begin() -> None:
            if not self._force.get_subscription_count():
                _settle(answer, f"no node subscribes to {self._force.topic_name}")
                return
            self._take_samples()
            self._force.publish(pack_wrench(self._run.newest, force))
            begins = self._timer is None and self._applied.get_publisher_count()
            wait = _LATEST_START if begins else 0.0
            self._asked, self._duration = self._run.newest, round(duration * NANOSECONDS)
            self._end = self._asked + round(wait * NANOSECONDS) + self._duration
            units = self._run.units
            push, lasting = units.text(force, "N"), units.text(duration, "s")
            self._run.add_event(f"impulse of {push} for {lasting}", push)
            if self._timer is None:
                self._timer = self._node.create_timer(0.002, self._take_samples, clock=self._clock)
            _settle(answer, "")

        _call_soon(self._node, begin)
        return answer

    def end_if_due(self) -> None:
        """End it if the newest sample is at its end, counted from the first that it acted on."""
        for start in wrench_columns(list(waiting_messages(self._applied)))[0].stamp:
            if start > self._asked:
                self._end = min(self._end, int(start) + self._duration)
        if self._timer is not None and self._run.newest >= self._end:
            self._stop(self._timer)

    def close(self) -> None:
        """End it now."""
        if self._timer is not None:
            self._stop(self._timer)
            self._force.wait_for_all_acked(Duration(seconds=1.0))

    def _stop(self, timer: Timer) -> None:
        self._force.publish(pack_wrench(self._run.newest, 0.0))
        self._run.add_event("the impulse has ended")
        self._node.destroy_timer(timer)
        self._timer = None


def _call_soon(node: Node, callback: Callable[[], None]) -> None:
    """Call back from the thread of the node."""

    def call() -> None:
        try:
            callback()
        except Exception as error:  # the executor would end the process silently
            node.get_logger().error(f"{type(error).__name__}: {error}")

    if node.executor is not None:
        node.executor.create_task(call)


def _settle(answer: Answer, result: str) -> None:
    """Set the answer unless it is already set or cancelled."""
    if not answer.done():
        answer.set_result(result)
