"""How much of the speed of bare ROS does the closed loop keep in lockstep?

Ours: plant, controller and analyzer of the scenario `paper` on one EventsExecutor, as by `stickslip
run --composed`, every sample answered, measured and recorded. A round trip is one sample.

Peers, on an executor of the same kind that is driven the same way: two nodes that do nothing but
play JointState and WrenchStamped back and forth. `typed`, with message objects, is what one writes
by hand; `serialized`, with bytes that are never looked at, is the limit of what rclpy gives.
"""

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.task import Future
from sensor_msgs.msg import JointState

from benchmarks.slices import Row, by_turns, compare_rates, show
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.managed import ManagedNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.process import spin
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.scenario.files import load_scenario

ROUNDS = 15
SAMPLES = 3000
TYPED_ROUND_TRIPS = 5000
SERIALIZED_ROUND_TRIPS = 15000
MATCHING_TIMEOUT = 20.0


class Plant(PlantNode):
    """Says when it pauses."""

    def start(self) -> None:
        self.paused = Future()
        super().start()

    def stop(self) -> None:
        super().stop()
        self.paused.set_result(None)


class ClosedLoop:
    """Our three nodes; a slice is one activation of the plant."""

    def __init__(self, bag: Path) -> None:
        scenario = load_scenario("paper")
        common = {"autostart": False}
        duration = SAMPLES / scenario.plant.rate
        listeners = ["analyzer", "washout_controller"]
        self._plant = Plant(
            overrides=scenario.plant.flat() | common | {"duration": duration, "wait_for": listeners}
        )
        self._analyzer = AnalyzerNode(
            overrides=scenario.analyzer.flat() | common | {"bag": str(bag)}
        )
        controller = WashoutControllerNode(
            overrides=scenario.washout_controller.flat()
            | common
            | {"wait_for": ["analyzer", "plant"]}
        )
        self._nodes: list[ManagedNode[Any]] = [self._analyzer, controller, self._plant]
        self._executor: Executor = EventsExecutor()
        for node in self._nodes:
            self._executor.add_node(node)
            node.trigger_configure()
        for node in self._nodes[:-1]:
            self._activate(node)

    def slice(self) -> float:
        """Return the samples per second of one activation."""
        start = time.perf_counter()
        self._activate(self._plant)
        spin(self._executor, self._plant.paused)
        rate = SAMPLES / (time.perf_counter() - start)
        figures = self._plant.diagnose()[2]
        if figures["samples"] != SAMPLES + 1 or figures["late_forces"] > 0:
            raise SystemExit(f"the plant did not run as it should: {figures}")
        return rate

    def close(self) -> None:
        """Close the bag; raises SystemExit if a sample is missing in it."""
        figures = self._analyzer.diagnose()[2]
        for node in reversed(self._nodes):
            if node.active:
                node.trigger_deactivate()
        if figures["lost_samples"] > 0:
            raise SystemExit(f"the analyzer has lost samples: {figures}")

    def _activate(self, node: ManagedNode[Any]) -> None:
        """Activate a node as soon as it is connected with those it waits for."""
        deadline = time.monotonic() + MATCHING_TIMEOUT
        node.trigger_activate()
        while not node.active:
            if time.monotonic() > deadline:
                raise SystemExit(f"{node.get_name()} was not connected in {MATCHING_TIMEOUT} s")
            spin_for(self._executor, 0.05)
            node.trigger_activate()


class PingPong:
    """Two bare nodes; a slice is `round_trips` states and forces."""

    def __init__(self, name: str, round_trips: int, *, serialized: bool) -> None:
        self._round_trips = round_trips
        self._executor: Executor = EventsExecutor()
        drive, controller = Node(f"{name}_drive"), Node(f"{name}_controller")
        for node in (drive, controller):
            self._executor.add_node(node)
        state_topic, force_topic = f"{name}/state", f"{name}/force"
        self._state = drive.create_publisher(JointState, state_topic, 10)
        self._force = controller.create_publisher(WrenchStamped, force_topic, 10)
        on_state: Callable[[Any], None] = self._on_bytes if serialized else self._on_state
        controller.create_subscription(JointState, state_topic, on_state, 10, raw=serialized)
        drive.create_subscription(WrenchStamped, force_topic, self._on_force, 10, raw=serialized)
        self._next_state = (lambda: self._state_bytes) if serialized else self._make_state
        self._state_bytes = serialize_message(self._make_state())
        self._force_bytes = serialize_message(WrenchStamped())
        deadline = time.monotonic() + MATCHING_TIMEOUT
        while not (self._state.get_subscription_count() and self._force.get_subscription_count()):
            if time.monotonic() > deadline:
                raise SystemExit(f"{name} was not connected in {MATCHING_TIMEOUT} s")
            spin_for(self._executor, 0.05)

    def slice(self) -> float:
        """Return the round trips per second."""
        self._left = self._round_trips
        self._done = Future()
        start = time.perf_counter()
        self._state.publish(self._next_state())
        spin(self._executor, self._done)
        return self._round_trips / (time.perf_counter() - start)

    def _make_state(self) -> JointState:
        message = JointState()
        message.header.stamp.sec, message.header.stamp.nanosec = 1, 2
        message.name = ["slide", "belt"]
        message.position = [0.1, 0.2]
        message.velocity = [0.3, 0.4]
        message.effort = [0.5, -0.5]
        return message

    def _on_state(self, state: JointState) -> None:
        message = WrenchStamped()
        message.header.stamp = state.header.stamp
        message.header.frame_id = "slide"
        message.wrench.force.x = -state.velocity[0]
        self._force.publish(message)

    def _on_bytes(self, _: bytes) -> None:
        self._force.publish(self._force_bytes)

    def _on_force(self, _: WrenchStamped | bytes) -> None:
        self._left -= 1
        if self._left > 0:
            self._state.publish(self._next_state())
        else:
            self._done.set_result(None)


def spin_for(executor: Executor, duration: float) -> None:
    executor.spin_until_future_complete(Future(), timeout_sec=duration)


def measure() -> list[Row]:
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rclpy.init(args=["--ros-args", "--log-level", "error"], domain_id=1 + os.getpid() % 100)
    try:
        with tempfile.TemporaryDirectory() as directory:
            loop = ClosedLoop(Path(directory) / "bag")
            typed = PingPong("typed", TYPED_ROUND_TRIPS, serialized=False)
            serialized = PingPong("serialized", SERIALIZED_ROUND_TRIPS, serialized=True)
            parties = (loop.slice, typed.slice, serialized.slice)
            by_turns(1, *parties)
            ours, typed_rates, serialized_rates = by_turns(ROUNDS, *parties)
            loop.close()
    finally:
        rclpy.try_shutdown()
    return [
        compare_rates("round trips, typed ping-pong", ours, typed_rates, required=0.5),
        compare_rates("round trips, serialized ping-pong", ours, serialized_rates),
    ]


if __name__ == "__main__":
    show(__doc__, measure)
