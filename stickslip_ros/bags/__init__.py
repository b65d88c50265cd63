"""MCAP bags in rosbag2's layout, written and read without a ROS graph."""

from stickslip_ros.bags.reader import Recording, RunBlock

__all__ = ["Recording", "RunBlock"]
