"""Stick-slip vibration of a feed drive: simulated, controlled and measured as ROS 2 nodes."""

from stickslip_ros.interrupts import end_quietly_if_interrupted, is_run

_SCRIPTS = ("stickslip", "plant_node", "washout_controller_node", "analyzer_node", "replay_node")

if is_run(__name__, *_SCRIPTS):
    end_quietly_if_interrupted()

from stickslip_ros.moved import find_moved_modules  # noqa: E402 - what takes time comes second

find_moved_modules()
