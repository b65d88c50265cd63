"""What ROS raises."""

from rclpy.impl.implementation_singleton import rclpy_implementation

RCLError: type[Exception] = rclpy_implementation.RCLError


def first_line(error: Exception) -> str:
    """Return what an exception of ROS's says, without where in its code and what follows."""
    return str(error).strip().split("\n", 1)[0].split(", at ", 1)[0].rstrip(":")
