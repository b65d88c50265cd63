"""How quickly does a recorded run become columns?

Ours: `Recording.blocks()` over a bag of one minute at 1 kHz, joint states and forces, lz4, a chunk
each second: every checksum is verified, all stamps, positions, velocities and forces become arrays.

Peers on the same bag: `rosbags`, every message deserialized (and, for the limit, not), and the mcap
library's own reader, which does not deserialize.
"""

import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from benchmarks.slices import Row, by_turns, compare_rates, show
from stickslip_ros.bags import Recording
from stickslip_ros.bags.messages import pack_joint_state, pack_wrench
from stickslip_ros.bags.recorder import QosProfile, Recorder

ROUNDS = 5
SAMPLES = 60_000
MESSAGES = 2 * SAMPLES
FLUSH_EVERY = 1000


def record(directory: Path) -> None:
    """Record a vibration of 16 Hz at 1 kHz."""
    with Recorder(directory) as recorder:
        qos = QosProfile(depth=10)
        states = recorder.add_topic("/feed_drive/joint_states", "sensor_msgs/msg/JointState", qos)
        forces = recorder.add_topic(
            "/feed_drive/control_force", "geometry_msgs/msg/WrenchStamped", qos
        )
        for number in range(SAMPLES):
            stamp = 1_000_000_000 + number * 1_000_000
            phase = 0.1 * number
            position, velocity = 1e-3 * math.sin(phase), 0.1 * math.cos(phase)
            friction = 300.0 * math.cos(phase)
            state = pack_joint_state(
                stamp, (position, 4e-5 * number), (velocity, 0.04), (friction, -friction)
            )
            recorder.write(states, state, stamp)
            recorder.write(forces, pack_wrench(stamp, -10.0 * velocity), stamp)
            if number % FLUSH_EVERY == FLUSH_EVERY - 1:
                recorder.flush()


def rate(read: Callable[[], int]) -> Callable[[], float]:
    """Return a slice that reads the bag once: messages per second of processor time."""

    def measure() -> float:
        started = time.process_time()
        count = read()
        elapsed = time.process_time() - started
        if count != MESSAGES:
            raise RuntimeError(f"{count} messages were read, {MESSAGES} are in the bag")
        return count / elapsed

    return measure


def make_rows() -> list[Row]:
    """Read by turns."""
    typestore = get_typestore(Stores.ROS2_JAZZY)
    with tempfile.TemporaryDirectory() as directory:
        bag = Path(directory, "bag")
        record(bag)

        def ours() -> int:
            with Recording(bag) as recording:
                count = sum(
                    len(block.joint_states.stamp) + len(block.control_forces.stamp)
                    for block in recording.blocks()
                )
                if not recording.complete:
                    raise RuntimeError(f"the bag is damaged: {recording.missing}")
            return count

        def decoded() -> int:
            with Reader(bag) as reader:
                return sum(
                    1
                    for connection, _, data in reader.messages()
                    if typestore.deserialize_cdr(data, connection.msgtype)
                )

        def undecoded() -> int:
            with Reader(bag) as reader:
                return sum(1 for _ in reader.messages())

        def library() -> int:
            with (bag / "bag_0.mcap").open("rb") as stream:
                return sum(1 for _ in make_reader(stream).iter_messages())

        rates = by_turns(ROUNDS, *map(rate, (ours, decoded, undecoded, library)))
    return [
        compare_rates("reading, rosbags decoded", rates[0], rates[1], required=10.0),
        compare_rates("reading, rosbags undecoded", rates[0], rates[2]),
        compare_rates("reading, mcap undecoded", rates[0], rates[3]),
    ]


if __name__ == "__main__":
    show(__doc__, make_rows)
