"""How late does a replayed message leave, at its recorded pace?

Ours: a minute of joint states and control forces at 1 kHz, replayed at rate 1 to an analyzer in a
process of its own. Lateness is counted from the deadline that the time of the first message and the
recorded spacing give; it does not add up.

Peer: a loop in another process that does nothing but sleep until the same deadlines, at the same
time, so that both suffer from whatever else this machine does.
"""

import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from benchmarks.slices import Row, show
from stickslip_ros.bags.messages import pack_joint_state, pack_wrench
from stickslip_ros.bags.recorder import QosProfile, Recorder
from stickslip_ros.nodes.player import Message
from stickslip_ros.nodes.process import spin
from stickslip_ros.nodes.replay import ReplayNode
from stickslip_ros.nodes.topics import CONTROL_FORCE, DEEP, JOINT_STATES
from stickslip_ros.physics.samples import NANOSECONDS

SAMPLES = 60_000
PERIOD = 0.001
NAMESPACE = "/feed_drive"
ALLOWED = 0.002
"""What the last message may be later than that of the bare loop, s."""


class TimedReplay(ReplayNode):
    """Notes when each joint state leaves."""

    def __init__(self, bag: Path, loop: Connection) -> None:
        self.times: list[float] = []
        self._loop = loop
        super().__init__(overrides={"bag": str(bag), "wait_for": ["analyzer"]})

    def start(self) -> None:
        self._loop.send("start")
        super().start()

    def stop(self) -> None:
        super().stop()
        self.stopped.set_result(None)

    def _publish(self, message: Message, recorded_time: int) -> None:
        if message[0].endswith(JOINT_STATES.name):
            self.times.append(time.monotonic())
        super()._publish(message, recorded_time)


def bare_loop(connection: Connection) -> None:
    """Sleep until the deadlines, once started, and send the times back."""
    times: list[float] = []
    connection.recv()
    origin = time.monotonic()
    for number in range(SAMPLES):
        wait = origin + number * PERIOD - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        times.append(time.monotonic())
    connection.send(times)


def record(bag: Path) -> None:
    """Write the bag as the analyzer does, a chunk each second."""
    step = round(PERIOD * NANOSECONDS)
    with Recorder(bag) as recorder:
        states, forces = (
            recorder.add_topic(f"{NAMESPACE}/{topic.name}", topic.type_name, QosProfile(DEEP))
            for topic in (JOINT_STATES, CONTROL_FORCE)
        )
        for number in range(SAMPLES):
            stamp = NANOSECONDS + number * step
            phase = 100.0 * number * PERIOD
            state = (np.sin(phase), 0.0), (np.cos(phase), 0.4), (0.0, 0.0)
            recorder.write(states, pack_joint_state(stamp, *state), stamp)
            recorder.write(forces, pack_wrench(stamp, phase), stamp)
            if number % 1000 == 999:
                recorder.flush()


def replay(bag: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return when each joint state left, and when the bare loop woke up."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    loop = context.Process(target=bare_loop, args=(theirs,))
    loop.start()
    arguments = ["--ros-args", "--log-level", "error", "-r", f"__ns:={NAMESPACE}"]
    analyzer = subprocess.Popen([sys.executable, "-m", "stickslip_ros.nodes.analyzer", *arguments])
    rclpy.init(
        args=["--ros-args", "--log-level", "error"], signal_handler_options=SignalHandlerOptions.NO
    )
    try:
        node = TimedReplay(bag, ours)
        executor = EventsExecutor()
        executor.add_node(node)
        spin(executor, node.stopped)
        refusal = node.stopped.result()
        if refusal is not None:
            raise refusal
        return np.array(node.times), np.array(ours.recv())
    finally:
        rclpy.try_shutdown()
        analyzer.terminate()
        analyzer.wait()
        loop.terminate()


def lateness(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how long after its deadline each came."""
    if len(times) != SAMPLES:
        raise SystemExit(f"{len(times)} joint states left, not {SAMPLES}")
    return times - times[0] - PERIOD * np.arange(SAMPLES)


def measure() -> list[Row]:
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
    with tempfile.TemporaryDirectory() as directory:
        bag = Path(directory) / "bag"
        record(bag)
        ours, bare = map(lateness, replay(bag))
    rows = [
        Row(f"lateness, {name}", "s", figure(ours), figure(bare), figure(bare) / figure(ours))
        for name, figure in (
            ("median", np.median),
            ("99 %", lambda late: np.quantile(late, 0.99)),
            ("largest", np.max),
        )
    ]
    last, last_bare = float(ours[-1]), float(bare[-1])
    limit = (last_bare + ALLOWED) / last
    return [*rows, Row("of the last (ratio: to peer + 2 ms)", "s", last, last_bare, limit, 1.0)]


if __name__ == "__main__":
    show(__doc__, measure)
