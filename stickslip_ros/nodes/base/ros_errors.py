"""Exceptions of ROS."""

from rclpy.impl.implementation_singleton import rclpy_implementation

RCLError: type[Exception] = rclpy_implementation.RCLError


def first_line(error: Exception) -> str:
    """Return the message of a ROS exception without the place in its source code."""
    return str(error).strip().split("\n", 1)[0].split(", at ", 1)[0].rstrip(":")
