"""Stick-slip vibration of a feed drive: simulated, controlled and measured as ROS 2 nodes."""

from stickslip_ros.interrupts import NODE_SCRIPTS, end_quietly_if_interrupted, is_run

if is_run(__name__, "stickslip", *NODE_SCRIPTS):
    end_quietly_if_interrupted()

from stickslip_ros.deprecated_names import find_moved_modules  # what takes time comes second

find_moved_modules()
