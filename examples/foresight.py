"""Velocity feedback that looks ahead: the force is for the time at which it will act."""

from contextlib import suppress
from math import cos, exp, sin

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState


class Foresight(Node):
    """Damps the vibration of a slide whose forces come late by a known delay."""

    def __init__(self):
        super().__init__("foresight")
        self.gain = self.declare_parameter("gain", 5000.0).value  # N s/m
        self.frequency = self.declare_parameter("frequency", 100.0).value  # of the slide, rad/s
        self.angle = self.frequency * self.declare_parameter("delay", 0.02).value  # delay in s
        self.time = self.middle = 0.0
        self.force = self.create_publisher(WrenchStamped, "control_force", 10)
        self.create_subscription(JointState, "joint_states", self.answer, 1)

    def answer(self, state):
        """Publish the force that answers a state of the drive."""
        slide = state.name.index("slide")
        position, velocity = state.position[slide], state.velocity[slide]
        # What the slide swings around: its mean position over the last 0.2 s or so.
        time = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        self.middle = position + (self.middle - position) * exp((self.time - time) / 0.2)
        self.time = time
        # A swing turns by this angle during the delay.
        ahead = velocity * cos(self.angle)
        ahead -= self.frequency * (position - self.middle) * sin(self.angle)
        force = WrenchStamped(header=state.header)  # stamped with the state that it answers
        force.wrench.force.x = -self.gain * ahead
        self.force.publish(force)


def main():
    """Run the node until Ctrl-C."""
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Foresight())


if __name__ == "__main__":
    main()
