import signal
import socket
import subprocess
import sys

import pytest

from stickslip_ros.errors import RunError
from stickslip_ros.testing import domain as domains
from stickslip_ros.testing import own_domain

HOLDER = """
import signal
from stickslip_ros.testing import own_domain
with own_domain() as domain:
    print(domain, flush=True)
    signal.pause()
"""


def test_nobody_else_gets_the_same_domain() -> None:
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
