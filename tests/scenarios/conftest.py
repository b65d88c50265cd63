from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.node import Node

from stickslip_ros.nodes.base.network import environment, this_machine_only
from stickslip_ros.testing import own_domain

ReadByRos = Callable[..., dict[str, Any]]

# What a node declares by itself.
OWN = {"use_sim_time": False, "start_type_description_service": True}


@pytest.fixture
def read_by_ros() -> Iterator[ReadByRos]:
    """Parameters that ROS itself gives to a node from a file; RuntimeError if there are none."""
    context = Context()

    def read(path: str, namespace: str = "/feed_drive", node: str = "plant") -> dict[str, Any]:
        made = Node(
            node,
            namespace=namespace,
            context=context,
            cli_args=["--ros-args", "--params-file", path],
            use_global_arguments=False,
            automatically_declare_parameters_from_overrides=True,
            enable_rosout=False,
            start_parameter_services=False,
        )
        parameters = made.get_parameters_by_prefix("")
        made.destroy_node()
        values = {name: found.value for name, found in parameters.items()}
        return {name: value for name, value in values.items() if value is not OWN.get(name)}

    with environment(this_machine_only()), own_domain() as domain:
        context.init(domain_id=domain)
        try:
            yield read
        finally:
            context.shutdown()
