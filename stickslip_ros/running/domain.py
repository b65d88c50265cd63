"""A ROS domain that no other process on this machine uses, and ROS in it."""

import gc
import os
import socket
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from threading import Lock

import rclpy
from rclpy.context import Context
from rclpy.node import Node

from stickslip_ros.errors import RunError
from stickslip_ros.nodes.base.machine_check import FIRST_PROCESS, is_free, port
from stickslip_ros.nodes.base.network import this_machine_only
from stickslip_ros.nodes.base.process import initialise

DOMAINS = range(1, 102)
"""Domains whose ports are all below the ephemeral ports of the system."""

_DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_NO_PEERS = {"ROS_STATIC_PEERS": ""}

_NO_LOGS_ELSEWHERE = ("--disable-external-lib-logs", "--disable-rosout-logs")
"""No log files in the home directory, and no /rosout topic, of which each node name has one."""

_initialising = Lock()


@contextmanager
def own_domain() -> Generator[int]:
    """Reserve a ROS domain that nothing else on this machine uses; a context manager.

    The domain is free again when the process ends, even if it is killed. Domains in which ROS
    already runs are skipped.

    Yields
    ------
    int
        Number of the domain, for `ROS_DOMAIN_ID`.

    Raises
    ------
    RunError
        If no domain is free.

    Examples
    --------
    >>> from stickslip_ros.testing import own_domain
    >>> with own_domain() as first, own_domain() as second:
    ...     first != second
    True
    """
    for domain in DOMAINS:
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as held:
            try:  # a port that DDS does not use; it uses no TCP ports at all
                held.bind(("127.0.0.1", port(domain, 5)))
            except OSError:
                continue
            # The ports that DDS uses in all processes of a domain, and in the first few.
            if all(is_free(port(domain, number)) for number in (0, 10, 12, 14, 16)):
                yield domain
                return
    raise RunError(f"every ROS domain from {DOMAINS[0]} to {DOMAINS[-1]} is in use on this machine")


def domain_variables(domain: int) -> dict[str, str]:
    """Return the environment variables of a process for a domain, loopback only."""
    return {**this_machine_only(), **_NO_PEERS, "ROS_DOMAIN_ID": str(domain)}


@contextmanager
def ros_context(domain: int, arguments: Sequence[str]) -> Generator[Context]:
    """Initialise ROS in a domain, loopback only, with these global arguments.

    This uses rclpy's default context, so that nodes need not name it, unless it is already in use.
    """
    _collect_before_forks()
    with _initialising:
        context = Context() if rclpy.ok() else rclpy.get_default_context()
        with _environment({**_this_process_only_here(), **_NO_PEERS}):
            initialise([*arguments, *_NO_LOGS_ELSEWHERE], context=context, domain=domain)
    try:
        yield context
    finally:
        # Only without a named context can the default one be initialised again.
        rclpy.try_shutdown(context=None if context is rclpy.get_default_context() else context)
        # Destroyed nodes of rclpy refer to each other, and hold threads, sockets and shared memory
        # of the middleware until they are collected.
        gc.collect()


@cache
def _collect_before_forks() -> None:
    """Collect nodes before a fork: a forked child lacks the threads that their end needs."""
    os.register_at_fork(before=gc.collect)


@cache
def _this_process_only_here() -> Mapping[str, str]:
    """Return the environment variables that restrict ROS in this process to the loopback.

    Fast DDS reads a profile once per process. If ROS was in use before ours could be read, it
    listens on every address; then LOCALHOST, which uses shared memory, is the best available.
    """
    variables = this_machine_only()
    context = Context()
    with own_domain() as domain, _environment({**variables, _DISCOVERY_RANGE: "OFF"}):
        initialise(["--ros-args", *_NO_LOGS_ELSEWHERE], context=context, domain=domain)
        node = Node("which_addresses", context=context)
        elsewhere_free = is_free(port(domain, FIRST_PROCESS), "127.0.0.2")
        node.destroy_node()
        rclpy.shutdown(context=context)
    return variables if elsewhere_free else {_DISCOVERY_RANGE: "LOCALHOST"}


@contextmanager
def _environment(variables: Mapping[str, str]) -> Generator[None]:
    before = {name: os.environ[name] for name in variables if name in os.environ}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables:
            del os.environ[name]
        os.environ.update(before)
