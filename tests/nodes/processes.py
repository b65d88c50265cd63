"""Processes of a test: our nodes, an unknown listener, and load on the machine."""

import signal
import subprocess
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.nodes.graph import wait_for

_LISTENER = """
import sys
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

rclpy.init()
node = rclpy.create_node("stranger", namespace="/test")
reliability = ReliabilityPolicy[sys.argv[1]]
qos = QoSProfile(depth=10, reliability=reliability)
node.create_subscription(JointState, "joint_states", lambda _: None, qos)
rclpy.spin(node)
"""


class Processes:
    """Starts processes in the domain of a test, and ends them all."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = environment
        self._started: list[subprocess.Popen[Any]] = []

    def node(self, name: str, **parameters: object) -> subprocess.Popen[bytes]:
        """Start one of our nodes in the namespace /test, or in the `namespace` given."""
        namespace = parameters.pop("namespace", "/test")
        arguments = ["-m", f"stickslip_ros.nodes.{name}", "--ros-args"]
        arguments += ["-r", f"__ns:={namespace}"]
        for key, value in parameters.items():
            arguments += ["-p", f"{key.replace('__', '.')}:={value}"]
        return self.start(arguments)

    def piped(self, node: str, *ros_arguments: str) -> subprocess.Popen[str]:
        """Start one of our nodes as `ros2 run` does, and keep what it prints."""
        command = ["-m", f"stickslip_ros.nodes.{node}", "--ros-args", *ros_arguments]
        return self.start(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def stranger(self, reliability: str = "RELIABLE") -> subprocess.Popen[bytes]:
        """Start a node that only listens to the joint states, as `ros2 topic echo` does."""
        return self.start(["-c", _LISTENER, reliability])

    def end(self) -> None:
        for process in self._started:
            process.kill()
            process.communicate()

    def start(self, arguments: list[Any], **options: Any) -> subprocess.Popen[Any]:
        """Start Python with these arguments."""
        given = {"env": self._environment, **options}
        process = subprocess.Popen([sys.executable, *arguments], **given)
        self._started.append(process)
        return process


def wait_for_samples(process: subprocess.Popen[Any], bag: Path) -> None:
    """Wait until the recorder of a process that runs has flushed some samples."""

    def recording() -> bool:
        assert process.poll() is None
        return sum(file.stat().st_size for file in bag.glob("*.mcap")) > 20_000

    wait_for(recording, "samples")


@contextmanager
def busy_machine(count: int = 2) -> Generator[None]:
    """Let so many processes do nothing but take processor time."""
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for burner in burners:
            burner.send_signal(signal.SIGKILL)
            burner.wait()
