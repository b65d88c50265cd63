"""What ROS itself reads from a parameter file."""

from typing import Any

from rclpy.context import Context
from rclpy.node import Node


def parameters_by_ros(path: str, namespace: str = "/feed_drive") -> dict[str, Any]:
    """Return the parameters that a node `plant` in that namespace is given."""
    context = Context()
    context.init(["test", "--ros-args", "--params-file", path])
    try:
        node = Node(
            "plant",
            namespace=namespace,
            context=context,
            automatically_declare_parameters_from_overrides=True,
            enable_rosout=False,
            start_parameter_services=False,
        )
        return {
            name: parameter.value
            for name, parameter in node.get_parameters_by_prefix("").items()
            if name != "use_sim_time"
        }
    finally:
        context.shutdown()
