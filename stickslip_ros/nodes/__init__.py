"""The ROS 2 nodes: thin shells around the physics; importing this package loads no ROS."""

import sys

from stickslip_ros.errors import RunError
from stickslip_ros.interrupts import end_quietly_if_interrupted, is_run
from stickslip_ros.nodes.base.shared_memory import check_shared_memory


def prepare_process() -> None:
    """Prepare this process for a node, before ROS is loaded, which takes a second."""
    end_quietly_if_interrupted()
    try:
        check_shared_memory()
    except RunError as error:
        sys.exit(f"stickslip_ros: {error}")


if is_run(__name__):
    prepare_process()
