"""Read and write MCAP bags in rosbag2's layout, without a ROS graph."""

from stickslip_ros.bags.reader import Recording, RunBlock

__all__ = ["Recording", "RunBlock"]
