"""Our nodes of a closed loop: what they are, and with which parameters they are made."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.scenarios.files import Scenario

LOOP_NODES: dict[str, Callable[..., ManagedNode[Any]]] = {
    "analyzer": AnalyzerNode,
    "washout_controller": WashoutControllerNode,
    "plant": PlantNode,
}
"""Every node by its name, in the order of activation."""


def node_parameters(scenario: Scenario, bag: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes that the scenario needs, in the order of activation.

    They are those of nodes that are to be activated from outside, and to record to `bag`.
    """
    values = scenario.as_dict()
    values["analyzer"]["bag"] = str(bag)
    return {
        node: {**values[node], "autostart": False}
        for node in LOOP_NODES
        if node != "washout_controller" or scenario.plant.expects_control
    }
