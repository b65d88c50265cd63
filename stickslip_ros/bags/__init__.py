"""MCAP bags in rosbag2's layout, written and read without a ROS graph."""
