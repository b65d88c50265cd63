"""The parameters that every node has, and the descriptions that several nodes share."""

import re
from dataclasses import dataclass
from typing import Any, Self

from typing_extensions import override

from stickslip_ros.model.constants import at_build, at_rest, constant
from stickslip_ros.scenarios.curve_file import Pairs
from stickslip_ros.scenarios.validation import ParameterGroup
from stickslip_ros.text import shown

SHORTEST_TIME = 1e-3
"""Shortest time-out or period of a node, s."""
_NAME = "[A-Za-z_][A-Za-z0-9_]*"
_NODE_NAME = re.compile(f"/?({_NAME}/)*{_NAME}")


@dataclass(frozen=True)
class NodeParameters(ParameterGroup):
    """Parameters that every node has."""

    autostart: bool = at_rest(True, "Configure and activate the node at start.")
    wait_for: list[str] = at_rest(
        [], "Nodes that must subscribe to this node's topics before it activates."
    )
    use_sim_time: bool = constant(False, "Take ROS time from /clock.")
    thread_priority: int = at_rest(
        0,
        "Priority (SCHED_FIFO) of the threads of the node's process; 0: ordinary scheduling.",
        whole=True,
        at_least=0,
        at_most=99,
    )
    cpu_affinity: int = at_rest(
        -1,
        "Processor on which the node's process runs; -1: any.",
        whole=True,
        at_least=-1,
        at_most=4095,
    )
    lock_memory: bool = at_rest(
        False,
        "Keep the memory of the node's process from being paged out.",
    )

    @override
    def completed(self, prefix: str, curves: dict[str, Pairs]) -> Self:
        if not all(_NODE_NAME.fullmatch(name) for name in self.wait_for):
            raise ValueError(
                f"wait_for = {shown(self.wait_for)} is invalid: must be names of nodes, "
                "of letters, digits and _, not starting with a digit"
            )
        return self


def numbered_force() -> Any:
    """Return the field of the number of the force in the messages of a controller."""
    return at_build(
        0,
        "Number of the force in the arrays on `control_force`, from 1; 0: they have only one.",
        whole=True,
        at_least=0,
        at_most=1000,
    )
