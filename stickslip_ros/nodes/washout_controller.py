"""Washout controller node: answers every joint state with a control force (eq. 17 and 18)."""

import sys
from math import isfinite
from typing import Any

from stickslip_ros.bags.messages import pack_wrench, unpack_joint_state
from stickslip_ros.errors import StickslipError
from stickslip_ros.nodes.managed import OK, WARN, Level, ManagedNode
from stickslip_ros.nodes.process import run_node
from stickslip_ros.nodes.topics import CONTROL_FORCE, JOINT_STATES
from stickslip_ros.physics.washout import Washout
from stickslip_ros.scenario.parameters import WashoutControllerParameters


class WashoutControllerNode(ManagedNode[WashoutControllerParameters]):
    """Subscribes to joint_states and publishes control_force, stamped with what it answers."""

    def __init__(self, **options: Any) -> None:
        super().__init__("washout_controller", WashoutControllerParameters, **options)

    def connect(self) -> None:
        """Publish forces; take the newest joint state only."""
        self._force = self.advertise(CONTROL_FORCE)
        self.subscribe(JOINT_STATES, self._on_joint_state, depth=1)

    def start(self) -> None:
        """Start the filter on the next joint state."""
        self._washout = Washout(self.parameters.as_washout())
        self._answered = 0
        self._refused = ""

    def stop(self) -> None:
        """Fall silent, once the forces sent have arrived."""
        self.wait_for_delivery(self._force)

    def apply_parameters(self) -> None:
        """Use new gains from the next joint state on."""
        if self.active:
            self._washout.parameters = self.parameters.as_washout()

    def diagnose(self) -> tuple[Level, str, dict[str, Any]]:
        """Return how many joint states were answered, and why the last refused one was."""
        if not self.active:
            return OK, "", {}
        level = WARN if self._refused else OK
        return level, self._refused, {"answered": self._answered}

    def _on_joint_state(self, message: bytes) -> None:
        if not self.active:
            return
        try:
            sample = unpack_joint_state(message)
        except StickslipError as error:
            self._refused = str(error)
            return
        if not isfinite(sample.velocity):
            self._refused = f"a joint state with velocity {sample.velocity} was dropped"
            return
        force = self._washout.answer(sample.stamp, sample.velocity)
        if force is not None:
            self._force.publish(pack_wrench(sample.stamp, force))
            self._answered += 1


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(WashoutControllerNode, WashoutControllerParameters))


if __name__ == "__main__":
    main()
