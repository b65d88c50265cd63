"""Needs of ROS on this machine: domains and namespaces held by processes, and the network."""

import errno
import os
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree

import pytest

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.nodes.base import network
from stickslip_ros.nodes.base.network import (
    lock_namespace,
    own_domain,
    prefer_prompt_middleware,
    this_machine_only,
)
from stickslip_ros.testing import ClosedLoop
from tests.nodes.graph import PATIENCE, wait_for
from tests.testing import controllers

HOLDER = """
import os, signal
from stickslip_ros.nodes.base.network import lock_namespace, own_domain
with own_domain() as domain, lock_namespace(f"/test/locked_{os.getppid()}", 7):
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
    ours = this_machine_only()  # set for all tests of nodes
    here = {name: value for name, value in os.environ.items() if name not in ours}
    here["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    finished = subprocess.run(command, env=here, capture_output=True, text=True, timeout=PATIENCE)
    assert finished.returncode == 0, finished.stderr
    assert (int(finished.stdout) > 0) == shared_memory


@pytest.mark.process
def test_a_domain_and_a_namespace_have_one_holder_until_it_is_killed() -> None:
    # All who test on this machine share these names.
    namespace = f"/test/locked_{os.getpid()}"
    with (
        subprocess.Popen([sys.executable, "-c", HOLDER], stdout=subprocess.PIPE) as holder,
        ExitStack() as ours,
    ):
        ours.callback(holder.kill)
        theirs = int(holder.stdout.readline())
        assert len({theirs, *(ours.enter_context(own_domain()) for _ in range(2))}) == 3
        ours.enter_context(lock_namespace(namespace, 8))
        ours.enter_context(lock_namespace(f"{namespace}/further", 7))
        for _ in range(3):
            with pytest.raises(InvalidInputError) as refusal, lock_namespace(namespace, 7):
                pass
            assert f"{namespace} of the ROS domain 7 is in use" in str(refusal.value)
            assert f"process {holder.pid}" in str(refusal.value)
        holder.send_signal(signal.SIGKILL)
        holder.wait()

        def is_free() -> bool:
            try:
                ours.enter_context(lock_namespace(namespace, 7))
            except InvalidInputError:
                return False
            return True

        wait_for(is_free, "the namespace is free")


def test_a_sandbox_that_refuses_to_bind_does_not_hinder_a_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("socket.socket.bind", refuse)
    with lock_namespace("/test/locked", 7):
        pass


@pytest.fixture
def only_domain(monkeypatch: pytest.MonkeyPatch) -> int:
    """The only domain that can be had: one of the last, since others take the first free one.

    Not that of the same test in another process.
    """
    only = network.DOMAINS[-5 - os.getpid() % 40]
    monkeypatch.setattr(network, "DOMAINS", [only])
    return only


def test_a_domain_that_is_in_use_is_waited_for_but_not_for_ever(
    only_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = f"every ROS domain from {only_domain} to {only_domain} is in use"
    with ExitStack() as holder:
        holder.enter_context(own_domain())
        monkeypatch.setattr("time.sleep", lambda _: None)
        with pytest.raises(RunError, match=told):
            own_domain().__enter__()
        monkeypatch.setattr("time.sleep", lambda _: holder.close())
        with own_domain() as domain:
            assert domain == only_domain


def test_a_domain_in_which_ros_runs_already_is_left_alone(
    only_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("time.sleep", lambda _: None)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(("", 7400 + 250 * only_domain + 10))
        with pytest.raises(RunError):
            own_domain().__enter__()


def test_a_loop_that_fails_leaves_its_domain_to_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though the failure is kept, and with it all that it went through."""
    monkeypatch.setattr(network, "DOMAINS", network.DOMAINS[-4:-2])  # one is for a look around
    failures = []
    for _ in range(3):
        with pytest.raises(ZeroDivisionError) as failure, ClosedLoop("paper", controller=None):
            raise ZeroDivisionError
        failures.append(failure)


@pytest.mark.parametrize("discovery_range", ["SUBNET", "LOCALHOST"])
def test_the_profile_that_is_named_is_there(discovery_range: str) -> None:
    profiles = "FASTRTPS_DEFAULT_PROFILES_FILE"
    before = dict(os.environ) | {"ROS_AUTOMATIC_DISCOVERY_RANGE": discovery_range}
    for name in (profiles, "FASTDDS_BUILTIN_TRANSPORTS", "ROS_LOCALHOST_ONLY"):
        before.pop(name, None)
    with mock.patch.dict(os.environ, before, clear=True):
        prefer_prompt_middleware()
        profile = Path(os.environ[profiles])
    assert profile.stem == ("loopback" if discovery_range == "LOCALHOST" else "network")
    assert ElementTree.parse(profile).getroot().tag.endswith("dds")
