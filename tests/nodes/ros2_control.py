"""A stand-in for joint_state_topic_hardware_interface of ros2_control, beside a controller.

It does what the C++ component does in `read` and `write` (ros-controls/topic_based_hardware_
interfaces): it keeps the newest joint state, and publishes the commands of all joints, with the
efforts of those that have this interface, unless they differ from the states by no more than a
threshold in sum.
"""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState


class HardwareInterface:
    """The hardware interface of a slide with an effort interface, and of a joint without one."""

    def __init__(
        self, node: Node, law: Callable[[float], float], *, threshold: float = 1e-5
    ) -> None:
        """Let `law` give the force, N, for the velocity, m/s, in each cycle."""
        self._node, self._law, self._threshold = node, law, threshold
        self._state = JointState()
        self.cycles = self.published = 0
        self._commands = node.create_publisher(JointState, "joint_commands", QoSProfile(depth=1))
        self.on_state: Callable[[], None] = lambda: None
        """Called after each joint state."""
        node.create_subscription(JointState, "joint_states", self._keep, qos_profile_sensor_data)

    @property
    def readers(self) -> int:
        """Number of nodes that read the commands."""
        return self._commands.get_subscription_count()

    @property
    def stamp(self) -> Any:
        """Stamp of the newest joint state."""
        return self._state.header.stamp

    def cycle(self) -> None:
        """Read, let the controller compute, and write."""
        if not self._state.name:
            return
        self.cycles += 1
        slide = self._state.name.index("slide")
        force = self._law(self._state.velocity[slide])
        if abs(self._state.effort[slide] - force) <= self._threshold:
            return
        command = JointState(name=["slide", "gripper"], effort=[force])
        command.header.stamp = self._node.get_clock().now().to_msg()
        self.publish(command)
        self.published += 1

    def publish(self, command: JointState) -> None:
        """Publish a command."""
        self._commands.publish(command)

    def _keep(self, state: JointState) -> None:
        self._state = state
        self.on_state()
