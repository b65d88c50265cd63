"""Controllers as a user writes them: plain rclpy nodes that do not use this package."""

import signal
import sys
import time
from contextlib import suppress
from threading import Event
from typing import Any

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from sensor_msgs.msg import JointState

GAIN = 0.7


class VelocityFeedback(Node):
    """Answers every state with a force against the slide's velocity."""

    gain: Any = GAIN

    def __init__(self, name: str = "velocity_feedback", **options: Any) -> None:
        super().__init__(name, **options)
        self.answered = 0
        self.force = self.create_publisher(WrenchStamped, "control_force", 1000)
        self.create_subscription(JointState, "joint_states", self.answer, 10)

    def answer(self, state: JointState) -> None:
        force = WrenchStamped(header=state.header)
        force.wrench.force.x = -self.gain * state.velocity[state.name.index("slide")]
        self.force.publish(force)
        self.answered += 1


class WithoutArguments(VelocityFeedback):
    def __init__(self) -> None:
        super().__init__()


class Informed(VelocityFeedback):
    """Has a callback of a kind that not every executor runs."""

    def __init__(self) -> None:
        super().__init__()
        self.received = 0
        self.create_subscription(JointState, "joint_states", self.look, 10)

    def look(self, state: JointState, info: Any) -> None:
        self.received = info["received_timestamp"]


class Commanding(Node):
    """Commands an effort, as controllers of ros2_control do: its stamps are of its own clock."""

    def __init__(self, name: str = "position_loop", **options: Any) -> None:
        super().__init__(name, **options)
        self.commands = self.create_publisher(JointState, "joint_commands", 1)
        self.create_subscription(JointState, "joint_states", self.command, 10)

    def command(self, state: JointState) -> None:
        effort = -GAIN * state.velocity[state.name.index("slide")]
        command = JointState(name=["slide"], effort=[effort])
        command.header.stamp = self.get_clock().now().to_msg()
        self.commands.publish(command)


class Raising(WithoutArguments):
    def answer(self, state: JointState) -> None:
        super().answer(state)
        if self.answered == 20:
            raise ValueError("twenty are enough")


class RaisingByItself(WithoutArguments):
    about_to_raise = Event()

    def __init__(self) -> None:
        super().__init__()
        self.create_timer(0.01, self.fail)

    def fail(self) -> None:
        self.about_to_raise.set()
        raise ValueError("by itself")


class Silent(WithoutArguments):
    def answer(self, state: JointState) -> None:
        self.answered += 1


class Damper(VelocityFeedback):
    """Has its gain as a parameter."""

    def __init__(self) -> None:
        super().__init__("damper")
        self.gain = self.declare_parameter("gain", 0.1).value


class Mortal(Damper):
    def answer(self, state: JointState) -> None:
        if state.header.stamp.sec == 2:
            sys.exit(3)
        super().answer(state)


class ForceOnly(Node):
    """Does not read what it should answer."""

    def __init__(self) -> None:
        super().__init__("damper")
        self.force = self.create_publisher(WrenchStamped, "control_force", 1000)


class DeafAndMute(Damper):
    def __init__(self) -> None:
        super().__init__()
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def answer(self, state: JointState) -> None:
        pass


class Managed(LifecycleNode):
    """Has publisher and subscription from when it is configured on, and publishes when active."""

    gain: Any = 0.0

    def __init__(self, name: str = "managed_feedback") -> None:
        super().__init__(name)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.force = self.create_lifecycle_publisher(WrenchStamped, "control_force", 1000)
        self.create_subscription(JointState, "joint_states", self.answer, 10)
        return TransitionCallbackReturn.SUCCESS

    def answer(self, state: JointState) -> None:
        force = WrenchStamped(header=state.header)
        force.wrench.force.x = -self.gain * state.velocity[0]
        self.force.publish(force)


class ManagedDamper(Managed):
    def __init__(self) -> None:
        super().__init__("damper")

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.gain = self.declare_parameter("gain", 0.1).value
        return super().on_configure(state)


class Refusing(LifecycleNode):
    def __init__(self) -> None:
        super().__init__("refusing")

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return TransitionCallbackReturn.FAILURE


class RefusingToStart(Managed):
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        raise ValueError("no")


class Slow(Managed):
    """Is configured for longer than an answer is waited for."""

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        time.sleep(5.0)
        return super().on_configure(state)


def main() -> None:
    rclpy.init()
    with suppress(ExternalShutdownException):
        try:
            rclpy.spin(globals()[sys.argv[1]]())
        except KeyboardInterrupt:
            print("ended as it should")


if __name__ == "__main__":
    main()
