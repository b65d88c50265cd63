import os
import signal
import socket
import subprocess
import sys

import pytest

from stickslip_ros.errors import RunError
from stickslip_ros.running import domain as domains
from stickslip_ros.testing import own_domain
from tests.testing import controllers

HOLDER = """
import signal
from stickslip_ros.testing import own_domain
with own_domain() as domain:
    print(domain, flush=True)
    signal.pause()
"""

EARLIER = """
import rclpy
with own_domain() as domain:
    rclpy.init(domain_id=domain)
    rclpy.create_node("earlier").destroy_node()
    rclpy.shutdown()
"""
LOOP = """
import sys
from stickslip_ros.testing import ClosedLoop, own_domain
{earlier}
with ClosedLoop("paper", controller=sys.argv[1:]) as loop:
    assert loop.run(0.1).late_forces == 0
    print(sum("/dev/shm/fast" in line for line in open("/proc/self/maps")))
"""


@pytest.mark.long
@pytest.mark.parametrize(("earlier", "shared_memory"), [("", False), (EARLIER, True)])
def test_a_loop_meets_its_controller_whatever_ros_was_used_for_before(
    earlier: str, shared_memory: bool
) -> None:
    controller = [sys.executable, controllers.__file__, "WithoutArguments"]
    command = [sys.executable, "-c", LOOP.format(earlier=earlier), *controller]
    here = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    finished = subprocess.run(command, env=here, capture_output=True, text=True, timeout=60)
    assert finished.returncode == 0, finished.stderr
    assert (int(finished.stdout) > 0) == shared_memory


@pytest.mark.process
def test_a_domain_has_one_holder() -> None:
    with own_domain() as first, own_domain() as second:
        assert first != second
    with subprocess.Popen([sys.executable, "-c", HOLDER], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        theirs = int(process.stdout.readline())
        with own_domain() as ours:
            assert ours != theirs
        process.send_signal(signal.SIGKILL)


def test_a_domain_is_free_again_after_its_holder(monkeypatch: pytest.MonkeyPatch) -> None:
    with own_domain() as domain:
        monkeypatch.setattr(domains, "DOMAINS", [domain])
        with pytest.raises(RunError, match=f"every ROS domain from {domain} to {domain} is in use"):
            own_domain().__enter__()
    with own_domain() as again:
        assert again == domain


def test_a_domain_in_which_ros_runs_already_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    with own_domain() as domain:
        monkeypatch.setattr(domains, "DOMAINS", [domain])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(("", 7400 + 250 * domain + 10))
        with pytest.raises(RunError):
            own_domain().__enter__()
