"""Washout controller node: answers every joint state with a control force (eq. 17 and 18)."""

import sys
from typing import Any

from stickslip_ros.model.control import Washout
from stickslip_ros.nodes.base.process import run_node
from stickslip_ros.nodes.controller import ControllerNode
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS


class WashoutControllerNode(ControllerNode):
    """The controller node of the washout law."""

    def __init__(self, **options: Any) -> None:
        super().__init__(Washout.name, **options)


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(WashoutControllerNode, CONTROLLER_PARAMETERS[Washout.name]))


if __name__ == "__main__":
    main()
