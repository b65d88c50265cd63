"""Names and parameters of the nodes of a closed loop. Importing this module does not load ROS."""

from pathlib import Path
from typing import Any

from stickslip_ros.scenarios.files import Scenario


def node_parameters(scenario: Scenario, bag: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes that a scenario needs, in the order of activation.

    The nodes do not activate themselves, and record to `bag`.
    """
    values = scenario.as_dict()
    values["analyzer"]["bag"] = str(bag)
    # The analyzer may know the parameters of the plant of a short run only at its end.
    stick_speed, noisy = scenario.reading
    if stick_speed and not noisy:
        values["analyzer"]["stick_speed"] = stick_speed
    controllers = [scenario.controller.node] if scenario.plant.expects_control else []
    nodes = ["analyzer", *controllers, "plant"]
    return {node: {**values[node], "autostart": False} for node in nodes}
