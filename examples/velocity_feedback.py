"""PD-style velocity feedback: a force against the slide's displacement and its velocity."""

from contextlib import suppress

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState


class VelocityFeedback(Node):
    """Acts as a spring and a damper between the slide and the machine's frame."""

    def __init__(self):
        super().__init__("velocity_feedback")
        self.stiffness = self.declare_parameter("stiffness", 2e5).value  # N/m
        self.damping = self.declare_parameter("damping", 6000.0).value  # N s/m
        self.force = self.create_publisher(WrenchStamped, "control_force", 10)
        self.create_subscription(JointState, "joint_states", self.answer, 1)

    def answer(self, state):
        """Publish the force that answers a state of the drive."""
        slide = state.name.index("slide")
        position, velocity = state.position[slide], state.velocity[slide]
        force = WrenchStamped(header=state.header)  # stamped with the state that it answers
        force.wrench.force.x = -self.stiffness * position - self.damping * velocity
        self.force.publish(force)


if __name__ == "__main__":
    with suppress(KeyboardInterrupt, ExternalShutdownException):  # Ctrl-C, and SIGTERM
        rclpy.init()
        rclpy.spin(VelocityFeedback())
