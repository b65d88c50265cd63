"""Names and parameters of the nodes of a closed loop. Importing this module does not load ROS."""

from pathlib import Path
from typing import Any

from stickslip_ros.scenarios.files import Scenario

LOOP_NODES = ("analyzer", "washout_controller", "plant")
"""Names of all nodes, in the order of activation; `stickslip_ros.nodes` has a module of each."""


def node_parameters(scenario: Scenario, bag: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes that a scenario needs, in the order of activation.

    The nodes do not activate themselves, and record to `bag`.
    """
    values = scenario.as_dict()
    values["analyzer"]["bag"] = str(bag)
    return {
        node: {**values[node], "autostart": False}
        for node in LOOP_NODES
        if node != "washout_controller" or scenario.plant.expects_control
    }
