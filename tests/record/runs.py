"""Bags with exactly known content."""

import resource
from collections.abc import Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

import numpy as np
from mcap.writer import Writer

from stickslip_ros.record.codec import pack_joint_state, pack_wrench
from stickslip_ros.record.recorder import Recorder
from stickslip_ros.record.topics import TOPICS

STATES = "/feed_drive/joint_states"
FORCES = "/feed_drive/control_force"
SECOND = 10**9
PERIOD = 2.0
"""Of the vibration, s."""


def motion(time):
    """Return position and velocity of an exact sine of amplitude 3 and PERIOD."""
    phase = 2.0 * np.pi * time / PERIOD
    return 3.0 * np.sin(phase), 3.0 * 2.0 * np.pi / PERIOD * np.cos(phase)


def state(stamp):
    position, velocity = motion(stamp / SECOND)
    return pack_joint_state(stamp, (position, 0.0), (velocity, 20.0), (0.0, 0.0))


def joint_state(stamp, position, velocity, effort, names=("slide", "belt"), frame=""):
    """Return a joint state as ROS has it."""
    from sensor_msgs.msg import JointState

    values = {"position": [*position], "velocity": [*velocity], "effort": [*effort]}
    message = JointState(name=[*names], **values)
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
    return message


def csv_of(path, **columns):
    """Write columns of numbers to a CSV file, to the last digit; return its path."""
    rows = zip(*(np.asarray(each).tolist() for each in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


STAMPS = [5 * SECOND + n * SECOND // 100 for n in range(1000)]


_TYPES = {topic.name: topic.type_name for topic in TOPICS}


def write_bag(
    directory,
    messages,
    *,
    topics=(),
    tables: Mapping[str, Any] = MappingProxyType({}),
    types: Mapping[str, str] = MappingProxyType({}),
    flush_every=0,
):
    """Record messages: topic, stamp (ns) and data of each. A topic of no name of ours is a number.

    `types` has the types of other topics.

    The `topics` are in the bag even if they have no message, and the `tables` of metadata by name.
    """
    channels = {}
    with Recorder(directory) as recorder:

        def channel(topic):
            if topic not in channels:
                kind = _TYPES.get(topic.rpartition("/")[2], "std_msgs/msg/Float64")
                kind = types.get(topic, kind)
                channels[topic] = recorder.add_topic(topic, kind, 10)
            return channels[topic]

        for name, table in tables.items():
            recorder.add_metadata(name, table)
        for topic in topics:
            channel(topic)
        for number, (topic, stamp, data) in enumerate(messages, 1):
            recorder.write(channel(topic), data, stamp)
            if flush_every and number % flush_every == 0:
                recorder.flush()


@contextmanager
def full_disk(size):
    """Let no file grow beyond so many bytes: what fails is what fails on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextmanager
def foreign_file(path, **options):
    """Write a file as another recorder does."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2")
        yield writer
        writer.finish()


def record(directory, states=STAMPS, forces=STAMPS, **contents):
    messages = [(STATES, stamp, state(stamp)) for stamp in states]
    messages += [(FORCES, stamp, pack_wrench(stamp, stamp / SECOND)) for stamp in forces]
    messages.sort(key=lambda message: message[1])
    write_bag(directory, messages, topics=(STATES, FORCES), **contents)
