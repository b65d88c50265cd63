"""How fast are bags written and read?

Writing, ours: serialized joint states and control forces are written to a bag as the analyzer
writes it: definitions are repeated, the limits of splits are checked, and flushed data are synced
to the disk. Peer: `mcap.writer.Writer` writes the same bytes to a file in chunks of the same size
and compression; its flushes reach the operating system only. Messages per second of wall time.

Reading, ours: `Recording.blocks()` over a minute at 1 kHz, lz4, in chunks of a second as in real
time and in full chunks as in lockstep: checksums are verified, and stamps, positions, velocities
and forces become arrays. Peers on the same bag: `rosbags` with every message deserialized (and, as
the limit, not), and the mcap library's reader, which does not deserialize. Messages per second of
processor time.
"""

import math
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from benchmarks.slices import Row, by_turns, compare_rates, show
from stickslip_ros.record.codec import pack_joint_state, pack_wrench
from stickslip_ros.record.definitions import message_definition
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.recorder import Recorder

ROUNDS = 60
SAMPLES = 2000
FLUSHED_MESSAGES = 1000
READING_ROUNDS = 5
READ_SAMPLES = 60_000
WRITING_REQUIRED = 0.9
READING_REQUIRED = 10.0
TYPES = {
    "/feed_drive/joint_states": "sensor_msgs/msg/JointState",
    "/feed_drive/control_force": "geometry_msgs/msg/WrenchStamped",
}

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)

Message = tuple[int, int, bytes]
"""Channel, stamp in ns and serialized message."""


class Run:
    """Records a drive at 1 kHz without end; a slice is a fixed number of its samples."""

    def __init__(
        self,
        write: Callable[..., None],
        arguments: Callable[[Message], tuple[Any, ...]],
        flush: Callable[[], None] | None,
    ) -> None:
        """Call `write` with its `arguments` for each message, and `flush` from time to time."""
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
    """Return joint state and force of a vibration, different at each stamp."""
    angle = 1e-7 * stamp
    position, velocity = math.sin(angle), 100.0 * math.cos(angle)
    positions, velocities = (position, 4e-11 * stamp), (velocity, 0.04)
    state = pack_joint_state(stamp, positions, velocities, (400.0 - velocity, velocity - 400.0))
    return (1, stamp, state), (2, stamp, pack_wrench(stamp, -3.0 * velocity))


def ours(directory: Path, resources: ExitStack, *, flushes: bool) -> Run:
    recorder = resources.enter_context(Recorder(directory))
    for topic, type_name in TYPES.items():
        recorder.add_topic(topic, type_name, 1000)
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


def writing() -> list[Row]:
    rows: list[Row] = []
    for flushed, flushes in (("without flushes", False), ("a flush each 1000", True)):
        with tempfile.TemporaryDirectory() as directory, ExitStack() as resources:
            run = ours(Path(directory, "bag"), resources, flushes=flushes)
            peers = peer(Path(directory, "peer.mcap"), resources, flushes=flushes)
            our_rates, peer_rates = by_turns(ROUNDS, run.slice, peers.slice)
        what = f"writing, {flushed}"
        rows.append(compare_rates(what, our_rates, "mcap", peer_rates, required=WRITING_REQUIRED))
    return rows


def reading() -> list[Row]:
    rows: list[Row] = []
    for chunks, flush_every in (("chunks of 1 s", 1000), ("full chunks", READ_SAMPLES)):
        with tempfile.TemporaryDirectory() as directory:
            bag = Path(directory, "bag")
            record(bag, flush_every)
            ours, decoded, undecoded, mcap = by_turns(
                READING_ROUNDS,
                *(
                    partial(reading_rate, read, bag)
                    for read in (read_columns, read_decoded, read_undecoded, read_with_mcap)
                ),
            )
        what = f"reading, {chunks}"
        rows += [
            compare_rates(what, ours, "rosbags", decoded, required=READING_REQUIRED),
            compare_rates(what, ours, "rosbags, undecoded", undecoded),
            compare_rates(what, ours, "mcap, undecoded", mcap),
        ]
    return rows


def record(directory: Path, flush_every: int) -> None:
    with Recorder(directory) as recorder:
        for topic, type_name in TYPES.items():
            recorder.add_topic(topic, type_name, 1000)
        for number in range(1, READ_SAMPLES + 1):
            for channel, stamp, data in sample(10**9 + number * 10**6):
                recorder.write(channel, data, stamp)
            if number % flush_every == 0:
                recorder.flush()


def reading_rate(read: Callable[[Path], int], bag: Path) -> float:
    """Return the messages per second of processor time."""
    started = time.process_time()
    count = read(bag)
    elapsed = time.process_time() - started
    if count != 2 * READ_SAMPLES:
        raise RuntimeError(f"{count} messages were read, {2 * READ_SAMPLES} are in the bag")
    return count / elapsed


def read_columns(bag: Path) -> int:
    with Recording(bag) as recording:
        count = sum(
            len(block.joint_states.stamp) + len(block.control_forces.stamp)
            for block in recording.blocks()
        )
        if not recording.complete:
            raise RuntimeError(f"the bag is damaged: {recording.missing}")
    return count


def read_decoded(bag: Path) -> int:
    with Reader(bag) as reader:
        return sum(
            1
            for connection, _, data in reader.messages()
            if TYPESTORE.deserialize_cdr(data, connection.msgtype)
        )


def read_undecoded(bag: Path) -> int:
    with Reader(bag) as reader:
        return sum(1 for _ in reader.messages())


def read_with_mcap(bag: Path) -> int:
    with (bag / "bag_0.mcap").open("rb") as stream:
        return sum(1 for _ in make_reader(stream).iter_messages())


if __name__ == "__main__":
    show(__doc__, lambda: writing() + reading())
