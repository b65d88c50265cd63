"""Bags of a run with exactly known content."""

import numpy as np

from stickslip_ros.bags.recorder import QosProfile, Recorder
from stickslip_ros.messages.codec import pack_joint_state, pack_wrench

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


STAMPS = [5 * SECOND + n * SECOND // 100 for n in range(1000)]


def record(directory, states=STAMPS, forces=STAMPS):
    with Recorder(directory) as recorder:
        qos = QosProfile(depth=10)
        state_channel = recorder.add_topic(STATES, "sensor_msgs/msg/JointState", qos)
        force_channel = recorder.add_topic(FORCES, "geometry_msgs/msg/WrenchStamped", qos)
        for stamp in sorted({*states, *forces}):
            if stamp in states:
                recorder.write(state_channel, state(stamp), stamp)
            if stamp in forces:
                recorder.write(force_channel, pack_wrench(stamp, stamp / SECOND), stamp)
