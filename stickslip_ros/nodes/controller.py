"""Controller node: answers every joint state with the force of a control law.

The parameter `law` chooses the law, and with it the name of the node, LAW_controller, and its
parameters. `stickslip list` prints the laws, and `stickslip new FILE --complete --controller LAW`
writes a file with the parameters of one, their meaning, unit and bounds.
"""

import sys
from dataclasses import replace
from typing import Any

from rclpy.exceptions import ParameterException
from rclpy.node import Node

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.motion.controller import ReferenceSource
from stickslip_ros.nodes.base.managed import OK, Diagnosis, ManagedNode, diagnosis
from stickslip_ros.nodes.base.parameters import first_line
from stickslip_ros.nodes.base.process import run_node
from stickslip_ros.record.codec import pack_reference, pack_wrench, unpack_asking_state
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES, REFERENCE
from stickslip_ros.samples import LARGEST, NO_REFERENCE, Reference, Sample
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    DEFAULT_LAW,
    ControllerChoice,
    ControllerParameters,
    controller_node,
    known_law,
)


class ControllerNode(ManagedNode[ControllerParameters]):
    """Subscribes to joint_states and answers each that asks with a control_force of its stamp.

    It publishes its reference, or subscribes to that of another node.
    """

    def __init__(self, law: str, **options: Any) -> None:
        super().__init__(controller_node(law), CONTROLLER_PARAMETERS[law], **options)

    def connect(self) -> None:
        """Publish forces; subscribe to the newest reference only."""
        self._force = self.read_last = self.advertise(CONTROL_FORCE)
        kind = self.parameters.reference.kind
        self._given = NO_REFERENCE
        self._reference = None
        if kind == "topic":
            self.subscribe(REFERENCE, self._on_reference, depth=1, while_active=False)
        elif kind != "none":
            self._reference = self.advertise(REFERENCE)

    def start(self) -> None:
        """Start the law on the next joint state: a plant takes one that listens for ready."""
        self._controller = self.parameters.as_controller()
        self._controller.follows = self._followed()
        self._answered = 0
        asking = replace(JOINT_STATES, decode=unpack_asking_state)
        self._states = self.subscribe(asking, self._on_joint_state, depth=1)

    def stop(self) -> None:
        """Listen no more, and stop once the forces sent have arrived."""
        self.release(self._states)
        super().stop()

    def apply_parameters(self) -> None:
        """Use new constants from the next joint state on."""
        if self.active:
            self._controller.law = self.parameters.control_law
            self._controller.follows = self._followed()

    def diagnose(self) -> Diagnosis:
        """Return how many joint states were answered, and problems with the others."""
        if not self.active:
            return OK, "", {}
        return diagnosis(
            [self.dropped.complaint, *self.duplicate_publishers(JOINT_STATES, REFERENCE)],
            {"answered": self._answered, **self.dropped.values},
        )

    def _followed(self) -> ReferenceSource:
        follows = self.parameters.reference
        if follows.kind == "topic":
            return lambda _: self._given
        return follows.signal(period=0.0).reference

    def _on_joint_state(self, sample: Sample | None) -> None:
        if sample is None:
            return
        stamp, position, velocity = sample.stamp, sample.position, sample.velocity
        if not (abs(velocity) <= LARGEST and abs(position) <= LARGEST):
            self.dropped.add(
                f"a joint state stamped {stamp} ns with the position {position} m and the velocity "
                f"{velocity} m/s"
            )
            return
        controller = self._controller
        try:
            force = controller.answer(sample)
        except RunError as error:
            self.dropped.add(f"a joint state stamped {stamp} ns: {error}")
            return
        if force is None:
            self.dropped.add(f"a joint state stamped {stamp} ns, not later than the last one")
        else:
            if self._reference is not None:
                self._reference.publish(pack_reference(stamp, controller.reference))
            self._force.publish(pack_wrench(stamp, force))
            self._answered += 1

    def _on_reference(self, stamped: tuple[int, Reference]) -> None:
        stamp, reference = stamped
        if not all(abs(value or 0.0) <= LARGEST for value in reference):
            self.dropped.add(
                f"a reference stamped {stamp} ns with the position {reference.position} m and the "
                f"velocity {reference.velocity} m/s"
            )
            return
        self._given = reference


def _chosen() -> ControllerNode:
    """Return the node of the law that the parameter `law` names."""
    try:
        asked = Node(
            "controller",
            start_parameter_services=False,
            enable_rosout=False,
            automatically_declare_parameters_from_overrides=True,
        )
    except (ParameterException, ValueError) as error:
        raise InvalidInputError(first_line(error)) from None
    law = asked.get_parameter("law").value if asked.has_parameter("law") else DEFAULT_LAW
    asked.destroy_node()
    return ControllerNode(known_law(str(law)))


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(_chosen, ControllerChoice()))


if __name__ == "__main__":
    main()
