from collections.abc import Callable, Iterator
from typing import Any

import pytest

ReadByRos = Callable[..., dict[str, Any]]

# What a node declares by itself.
OWN = {"use_sim_time", "start_type_description_service"}


@pytest.fixture
def read_by_ros(monkeypatch: pytest.MonkeyPatch) -> Iterator[ReadByRos]:
    """What ROS itself gives to a node `plant` from a parameter file."""
    context_module = pytest.importorskip("rclpy.context")
    node_module = pytest.importorskip("rclpy.node")
    from stickslip_ros.nodes.base.network import this_machine_only
    from stickslip_ros.testing import own_domain

    for name, value in this_machine_only().items():
        monkeypatch.setenv(name, value)

    def read(path: str, namespace: str = "/feed_drive") -> dict[str, Any]:
        context = context_module.Context()
        context.init(["test", "--ros-args", "--params-file", path], domain_id=domain)
        try:
            node = node_module.Node(
                "plant",
                namespace=namespace,
                context=context,
                automatically_declare_parameters_from_overrides=True,
                enable_rosout=False,
                start_parameter_services=False,
            )
            parameters = node.get_parameters_by_prefix("")
            node.destroy_node()
        finally:
            context.shutdown()
        return {name: found.value for name, found in parameters.items() if name not in OWN}

    with own_domain() as domain:
        yield read
