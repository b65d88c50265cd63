"""Stick-slip vibration of a feed drive: simulated, controlled and measured as ROS 2 nodes."""
