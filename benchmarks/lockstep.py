"""How much of the speed of bare ROS does the closed loop keep in lockstep?

Ours: plant, controller and analyzer of the scenario `paper`, as in `stickslip run` with and without
`--composed`: on one EventsExecutor, or as three processes. A round trip is one sample. For each
sample, the plant unpacks a force, integrates to the next sample, packs and publishes the state; the
controller unpacks the state, filters and answers; the analyzer receives both, writes them to a bag
and measures the cycles. From time to time the analyzer reports its progress to the plant, which
waits if the analyzer is too far behind.

Peers: two nodes that only send JointState and WrenchStamped back and forth, on one EventsExecutor,
or each in its own process. `typed` uses message objects, as in common user code. `serialized`
passes bytes without decoding them: this is the limit of rclpy.
"""

import multiprocessing
import signal
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.task import Future
from sensor_msgs.msg import JointState

from benchmarks.parties import (
    ObservedPlant,
    Slice,
    closed_loop,
    party,
    results_by_turns,
    ros,
    spin_for,
    wait_until_connected,
)
from benchmarks.slices import Row, compare_rates, show
from stickslip_ros.nodes.base.spinner import spin

ROUNDS = 11
SLICE_TIME = 0.7
"""Approximate duration of a slice, s."""
FIRST_SLICE = 2000

TYPED, SERIALIZED = "typed ping-pong", "serialized ping-pong"
STATE, FORCE = "state", "force"
SERIALIZED_AIM = 0.3


@contextmanager
def ours(composed: bool) -> Generator[Slice[float]]:
    with closed_loop(ObservedPlant, "paper", composed=composed) as loop:

        def run(samples: int) -> float:
            loop.run(samples)
            figures = loop.plant.diagnose()[2]
            if figures["late_forces"] > 0:
                raise SystemExit(f"lockstep continued without a force: {figures}")
            return figures["steps_per_second"]

        yield run


class Drive:
    """Sends a state, and the next one when the force has arrived."""

    def __init__(self, *, serialized: bool) -> None:
        self.node = Node("drive")
        self.state = self.node.create_publisher(JointState, STATE, 10)
        self.node.create_subscription(WrenchStamped, FORCE, self._on_force, 10, raw=serialized)
        state_bytes = serialize_message(self._make_state())
        self._next_state = (lambda: state_bytes) if serialized else self._make_state

    def run(self, executor: Executor, round_trips: int) -> float:
        """Return the round trips per second."""
        self._left = round_trips
        self._done = Future()
        started = time.perf_counter()
        self.state.publish(self._next_state())
        spin(executor, self._done)
        return round_trips / (time.perf_counter() - started)

    def _make_state(self) -> JointState:
        message = JointState()
        message.header.stamp.sec, message.header.stamp.nanosec = 1, 2
        message.name = ["slide", "belt"]
        message.position = [0.1, 0.2]
        message.velocity = [0.3, 0.4]
        message.effort = [0.5, -0.5]
        return message

    def _on_force(self, _: WrenchStamped | bytes) -> None:
        self._left -= 1
        if self._left > 0:
            self.state.publish(self._next_state())
        else:
            self._done.set_result(None)


class Controller:
    """Answers each state with a force."""

    def __init__(self, *, serialized: bool) -> None:
        self.node = Node("controller")
        self.force = self.node.create_publisher(WrenchStamped, FORCE, 10)
        on_state: Any = self._on_bytes if serialized else self._on_state
        self.node.create_subscription(JointState, STATE, on_state, 10, raw=serialized)
        self._force_bytes = serialize_message(WrenchStamped())

    def _on_state(self, state: JointState) -> None:
        message = WrenchStamped()
        message.header.stamp = state.header.stamp
        message.header.frame_id = "slide"
        message.wrench.force.x = -state.velocity[0]
        self.force.publish(message)

    def _on_bytes(self, _: bytes) -> None:
        self.force.publish(self._force_bytes)


@contextmanager
def ping_pong(serialized: bool, composed: bool) -> Generator[Slice[float]]:
    with ExitStack() as resources:
        if not composed:
            answering = multiprocessing.get_context("spawn").Process(
                target=pong, args=(serialized,)
            )
            answering.start()
            resources.callback(answering.terminate)
        resources.enter_context(ros())
        drive = Drive(serialized=serialized)
        executor = EventsExecutor()
        executor.add_node(drive.node)
        publishers = [drive.state]
        if composed:
            controller = Controller(serialized=serialized)
            executor.add_node(controller.node)
            publishers.append(controller.force)
        wait_until_connected(executor, *publishers)
        yield partial(drive.run, executor)


def pong(serialized: bool) -> None:
    """Run the controller until the parent process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    with ros():
        controller = Controller(serialized=serialized)
        executor = EventsExecutor()
        executor.add_node(controller.node)
        while parent is not None and parent.is_alive():
            spin_for(executor, 1.0)


def measure() -> list[Row]:
    rows: list[Row] = []
    for name, composed, typed_required in (("composed", True, 1.0), ("processes", False, 0.7)):
        loop = f"steps, {name}"
        parties = {
            loop: party(ours, composed),
            TYPED: party(ping_pong, False, composed),
            SERIALIZED: party(ping_pong, True, composed),
        }
        rates, failures = results_by_turns(
            ROUNDS, parties, lambda run: round(SLICE_TIME * run(FIRST_SLICE))
        )
        aim = SERIALIZED_AIM if composed else None
        for peer, required, aimed in ((TYPED, typed_required, None), (SERIALIZED, None, aim)):
            if loop in rates and peer in rates:
                rows.append(
                    compare_rates(
                        loop, rates[loop], peer, rates[peer], required=required, aim=aimed
                    )
                )
        rows += failures
    return rows


if __name__ == "__main__":
    show(__doc__, measure)
