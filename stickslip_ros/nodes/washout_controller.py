"""Washout controller node: answers every joint state with a control force (eq. 17 and 18)."""

import sys
from math import isfinite
from typing import Any

from stickslip_ros.messages.codec import pack_wrench
from stickslip_ros.messages.topics import CONTROL_FORCE, JOINT_STATES
from stickslip_ros.nodes.base.duplicate_publishers import duplicate_publishers
from stickslip_ros.nodes.base.managed import OK, Diagnosis, ManagedNode, diagnosis
from stickslip_ros.nodes.base.process import run_node
from stickslip_ros.physics.loop.washout import Washout
from stickslip_ros.samples import LARGEST, Sample
from stickslip_ros.scenarios.parameters import WashoutControllerParameters


class WashoutControllerNode(ManagedNode[WashoutControllerParameters]):
    """Subscribes to joint_states and publishes control_force with the stamp of each sample."""

    def __init__(self, **options: Any) -> None:
        super().__init__("washout_controller", WashoutControllerParameters, **options)

    def connect(self) -> None:
        """Publish forces; subscribe to the newest joint state only."""
        self._force = self.advertise(CONTROL_FORCE)
        self.subscribe(JOINT_STATES, self._on_joint_state, depth=1)

    def start(self) -> None:
        """Start the filter on the next joint state."""
        self._washout = Washout(self.parameters.as_washout())
        self._answered = 0

    def apply_parameters(self) -> None:
        """Use new gains from the next joint state on."""
        if self.active:
            self._washout.parameters = self.parameters.as_washout()

    def diagnose(self) -> Diagnosis:
        """Return how many joint states were answered, and problems with the others."""
        if not self.active:
            return OK, "", {}
        return diagnosis(
            [self.dropped.complaint, *duplicate_publishers(self, JOINT_STATES)],
            {"answered": self._answered, **self.dropped.figures},
        )

    def _on_joint_state(self, sample: Sample) -> None:
        stamp, velocity = sample.stamp, sample.velocity
        if not abs(velocity) <= LARGEST:
            self.dropped.add(f"a joint state stamped {stamp} ns with the velocity {velocity} m/s")
            return
        force = self._washout.answer(stamp, velocity)
        if force is None:
            self.dropped.add(f"a joint state stamped {stamp} ns, not later than the last one")
        elif not isfinite(force):
            self.dropped.add(f"to the velocity {velocity} m/s the force would be {force} N")
        else:
            self._force.publish(pack_wrench(stamp, force))
            self._answered += 1


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(WashoutControllerNode, WashoutControllerParameters))


if __name__ == "__main__":
    main()
