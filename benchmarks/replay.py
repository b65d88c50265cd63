"""How late is a message published in a replay at its recorded rate?

Ours: half a minute of joint states and control forces at 1 kHz, replayed at rate 1 to an analyzer
in another process. The deadline of a message follows from the time of the first message and the
recorded spacing. Lateness is measured from the deadline; it is not accumulated.

Peer: a loop in another process that only sleeps until the same deadlines, at the same time, so that
other load on this machine affects both.
"""

import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from rclpy.experimental import EventsExecutor

from benchmarks.lateness import SLEEP_LOOP, lateness, lateness_rows, sleep_loop
from benchmarks.parties import ROS_ARGUMENTS, ros
from benchmarks.slices import Row, show
from stickslip_ros.nodes.base.child_process import start_child
from stickslip_ros.nodes.base.network import domain_variables, own_domain
from stickslip_ros.nodes.base.spinner import spin
from stickslip_ros.nodes.replay import ReplayNode
from stickslip_ros.nodes.replaying.player import Message
from stickslip_ros.record.codec import pack_joint_state, pack_wrench
from stickslip_ros.record.recorder import Recorder
from stickslip_ros.record.topics import CONTROL_FORCE, DEEP, JOINT_STATES
from stickslip_ros.scenarios import DEFAULT_NAMESPACE
from stickslip_ros.stamps import NANOSECONDS

SAMPLES = 30_000
PERIOD = 0.001
ALLOWED = 0.002
"""Allowed lateness of the last message beyond that of the bare loop, s."""


class TimedReplay(ReplayNode):
    """Stores when each joint state is published."""

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
    """Sleep until each deadline, once started, and send the times back."""
    connection.recv()
    connection.send(sleep_loop(SAMPLES, PERIOD))


def record(bag: Path) -> None:
    """Write the bag as the analyzer does, a chunk each second."""
    step = round(PERIOD * NANOSECONDS)
    with Recorder(bag) as recorder:
        states, forces = (
            recorder.add_topic(f"{DEFAULT_NAMESPACE}/{topic.name}", topic.type_name, DEEP)
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


def replay(bag: Path) -> tuple[Sequence[float], Sequence[float]]:
    """Return when each joint state was published, and when the bare loop woke up."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    loop = context.Process(target=bare_loop, args=(theirs,))
    loop.start()
    analyzer = start_child([sys.executable, "-m", "stickslip_ros.nodes.analyzer", *ROS_ARGUMENTS])
    try:
        with ros():
            node = TimedReplay(bag, ours)
            executor = EventsExecutor()
            executor.add_node(node)
            spin(executor, node.stopped)
            refusal = node.stopped.result()
        if refusal is not None:
            raise refusal
        return node.times, ours.recv()
    finally:
        analyzer.terminate()
        analyzer.wait()
        loop.terminate()


def measure() -> list[Row]:
    with own_domain() as domain, tempfile.TemporaryDirectory() as directory:
        os.environ.update(domain_variables(domain))
        bag = Path(directory) / "bag"
        record(bag)
        our_times, bare_times = replay(bag)
    if len(our_times) != SAMPLES:
        raise SystemExit(f"{len(our_times)} joint states were published, not {SAMPLES}")
    late, bare = (lateness(times, PERIOD) for times in (our_times, bare_times))
    last, last_bare = float(late[-1]), float(bare[-1])
    return [
        *lateness_rows("messages", late, SLEEP_LOOP, bare),
        Row(
            "last message, lateness (ratio: to peer + 2 ms)",
            "s",
            last,
            SLEEP_LOOP,
            last_bare,
            (last_bare + ALLOWED) / last,
            required=1.0,
        ),
    ]


if __name__ == "__main__":
    show(__doc__, measure)
