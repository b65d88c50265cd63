"""How much of the speed of MCAP's own writer does our recorder keep?

Ours: joint states and control forces, serialized already, into a bag as the analyzer writes it:
definitions are repeated, splits looked out for, and what is flushed is handed to the disk.

Peer: `mcap.writer.Writer` into a file, the same bytes in chunks of the same size and compression;
its flushes end with the operating system.
"""

import math
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from benchmarks.slices import Row, by_turns, compare_rates, show
from stickslip_ros.bags.definitions import message_definition
from stickslip_ros.bags.messages import pack_joint_state, pack_wrench
from stickslip_ros.bags.recorder import QosProfile, Recorder

ROUNDS = 100
SAMPLES = 2000
FLUSHED_MESSAGES = 1000
REQUIRED = 0.9
TYPES = {
    "/feed_drive/joint_states": "sensor_msgs/msg/JointState",
    "/feed_drive/control_force": "geometry_msgs/msg/WrenchStamped",
}

Message = tuple[int, int, bytes]
"""Channel, stamp in ns and serialized message."""


class Run:
    """Records a drive at 1 kHz without end; a slice is so many samples of it."""

    def __init__(
        self,
        write: Callable[..., None],
        arguments: Callable[[Message], tuple[Any, ...]],
        flush: Callable[[], None] | None,
    ) -> None:
        """Call `write` with its `arguments` for each message, and `flush` at times."""
        self._write = write
        self._arguments = arguments
        self._flush = flush
        self._stamps = count(10**9, 10**6)

    def slice(self) -> float:
        """Return the messages per second."""
        messages = [
            self._arguments(message)
            for stamp, _ in zip(self._stamps, range(SAMPLES), strict=False)
            for message in sample(stamp)
        ]
        write, flush = self._write, self._flush
        started = time.perf_counter()
        for number, message in enumerate(messages, start=1):
            write(*message)
            if flush is not None and number % FLUSHED_MESSAGES == 0:
                flush()
        return len(messages) / (time.perf_counter() - started)


def sample(stamp: int) -> tuple[Message, Message]:
    """Return joint state and force of a vibration, no two of which are alike."""
    angle = 1e-7 * stamp
    position, velocity = math.sin(angle), 100.0 * math.cos(angle)
    positions, velocities = (position, 4e-11 * stamp), (velocity, 0.04)
    state = pack_joint_state(stamp, positions, velocities, (400.0 - velocity, velocity - 400.0))
    return (1, stamp, state), (2, stamp, pack_wrench(stamp, -3.0 * velocity))


def ours(directory: Path, resources: ExitStack, *, flushes: bool) -> Run:
    recorder = resources.enter_context(Recorder(directory))
    for topic, type_name in TYPES.items():
        recorder.add_topic(topic, type_name, QosProfile(depth=1000))
    return Run(recorder.write, lambda m: (m[0], m[2], m[1]), recorder.flush if flushes else None)


def peer(path: Path, resources: ExitStack, *, flushes: bool) -> Run:
    writer = Writer(resources.enter_context(path.open("wb")), compression=CompressionType.LZ4)
    resources.callback(writer.finish)
    writer.start(profile="ros2")
    for topic, type_name in TYPES.items():
        definition = message_definition(type_name).encode()
        schema = writer.register_schema(type_name, "ros2msg", definition)
        writer.register_channel(topic, "cdr", schema)
    return Run(writer.add_message, lambda m: (*m, m[1]), writer.flush if flushes else None)


def measure() -> list[Row]:
    """Return the table."""
    rows: list[Row] = []
    for what, flushes in (("without flushes", False), ("a flush each 1000", True)):
        with tempfile.TemporaryDirectory() as directory, ExitStack() as resources:
            run = ours(Path(directory, "bag"), resources, flushes=flushes)
            peers = peer(Path(directory, "peer.mcap"), resources, flushes=flushes)
            rates = by_turns(ROUNDS, run.slice, peers.slice)
        rows.append(compare_rates(f"messages, {what}", *rates, required=REQUIRED))
    return rows


if __name__ == "__main__":
    show(__doc__, measure)
