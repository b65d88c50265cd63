"""The ROS 2 nodes: thin shells around the physics. Importing this package does not load ROS."""

import sys

from stickslip_ros.errors import RunError
from stickslip_ros.interrupts import NODE_SCRIPTS, is_run
from stickslip_ros.nodes.base.machine import check_shared_memory

if is_run(__name__, *NODE_SCRIPTS):
    try:
        check_shared_memory()
    except RunError as error:
        sys.exit(f"stickslip_ros: {error}")
