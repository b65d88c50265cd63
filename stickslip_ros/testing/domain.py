"""A ROS domain that nobody else on this machine uses, and ROS in it."""

import gc
import os
import socket
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from threading import Lock

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from stickslip_ros.errors import RunError

DOMAINS = range(1, 102)
"""Domains all ports of which are below those that the system gives away."""

_THIS_MACHINE_ONLY = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": ""}

_NO_LOGS_ELSEWHERE = ("--disable-external-lib-logs", "--disable-rosout-logs")
"""No files in the home directory; and no topic, of which a process has one for each node name."""

_FIRST_PORT, _PORTS_OF_A_DOMAIN = 7400, 250
_FREE_PORT = 5
"""A port of the domain that DDS leaves alone, as are those of TCP."""
_DISCOVERY_PORTS = (0, 10, 12, 14, 16)
"""What DDS listens on in every process of a domain, and in the first few."""

_initialising = Lock()


@contextmanager
def own_domain() -> Generator[int]:
    """Hold a ROS domain that no other holder on this machine has, whichever process it is in.

    It is free again when its holder ends, in whatever way. Domains in which ROS runs already are
    left alone. Raises RunError if none is left.
    """
    for domain in DOMAINS:
        first = _FIRST_PORT + _PORTS_OF_A_DOMAIN * domain
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as held:
            if not _bind(held, "127.0.0.1", first + _FREE_PORT):
                continue
            if all(_is_free(first + port) for port in _DISCOVERY_PORTS):
                yield domain
                return
    raise RunError(f"every ROS domain from {DOMAINS[0]} to {DOMAINS[-1]} is in use on this machine")


def domain_variables(domain: int) -> dict[str, str]:
    """Return the environment variables of a process that is to be in a domain, on this machine.

    Fast DDS is to do without shared memory there, which a process that is killed leaves behind.
    """
    return {
        **_THIS_MACHINE_ONLY,
        "ROS_DOMAIN_ID": str(domain),
        "FASTDDS_BUILTIN_TRANSPORTS": os.environ.get("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4"),
    }


@contextmanager
def ros_context(domain: int, arguments: Sequence[str]) -> Generator[Context]:
    """Initialise ROS in a domain, on this machine only, with these global arguments.

    That is rclpy's default context, so that nodes which name none are in it, unless that is in
    use already.
    """
    with _initialising:
        context = Context() if rclpy.ok() else rclpy.get_default_context()
        before = {name: os.environ.get(name) for name in _THIS_MACHINE_ONLY}
        os.environ.update(_THIS_MACHINE_ONLY)
        try:
            rclpy.init(
                args=[*arguments, *_NO_LOGS_ELSEWHERE],
                context=context,
                domain_id=domain,
                signal_handler_options=SignalHandlerOptions.NO,
            )
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value
    try:
        yield context
    finally:
        if context is rclpy.get_default_context():
            rclpy.try_shutdown()  # with no context named it can be initialised again
        else:
            rclpy.try_shutdown(context=context)
        # What rclpy's destroyed nodes still hold, threads, sockets and shared memory of the
        # middleware, goes with the last of them, and they refer to each other.
        gc.collect()


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        return _bind(probe, "", port)


def _bind(free: socket.socket, address: str, port: int) -> bool:
    try:
        free.bind((address, port))
    except OSError:
        return False
    return True
