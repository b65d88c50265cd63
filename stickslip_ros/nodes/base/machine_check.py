"""Check what ROS needs from this machine: free ports, the clock, the loopback, memory."""

import errno
import os
import re
import socket
import time
from datetime import UTC, datetime

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.nodes.base.network import TRANSPORTS, is_fast_dds, is_kept_on_loopback
from stickslip_ros.nodes.base.shared_memory import SHARED_MEMORY, free_shared_memory
from stickslip_ros.stamps import END_OF_TIME, NANOSECONDS

FIRST_PROCESS = 10
"""Number in the domain of the first port that belongs to one process; each process has two."""

_DOMAIN = "ROS_DOMAIN_ID"
_LARGEST_DOMAIN = 232
_DECIMAL = re.compile(r"0|[1-9][0-9]{0,20}")
_LEAST_SHARED_MEMORY = 1 << 20
"""Bytes that a process of Fast DDS uses at most, rounded up."""


def check_machine(domain: int) -> None:
    """Raise InvalidInputError if nodes cannot run because of the clock, the network or the domain.

    The middleware reports these problems unclearly or not at all.
    """
    now = time.time_ns()
    if not 0 < now < END_OF_TIME:
        year = datetime.fromtimestamp(now / NANOSECONDS, UTC).year
        raise InvalidInputError(
            f"the clock of this machine shows the year {year}: the stamps of ROS messages "
            "range from 1970 to January 2038"
        )
    if is_kept_on_loopback() and not _reaches_itself():
        raise InvalidInputError(
            "the loopback interface of this machine is down, and the nodes need it: "
            "ip link set lo up"
        )
    if is_fast_dds():
        _check_ports(domain)
        _check_shared_memory()


def port(domain: int, number: int) -> int:
    """Return the UDP port of a domain with this number, from 0 to 249 (RTPS 2.5, 9.6.2.4)."""
    return 7400 + 250 * domain + number


def is_free(taken: int, address: str = "", *, shared: bool = False) -> bool:
    """Return whether a UDP port is free, or can be `shared` with the processes that share it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, shared)
        try:
            probe.bind((address, taken))
        except OSError as error:
            return error.errno != errno.EADDRINUSE
    return True


def _check_ports(domain: int) -> None:
    shared = port(domain, 0)
    # Fast DDS listens on these two addresses if it uses the loopback only.
    for address in ("127.0.0.1", "239.255.0.1") if is_kept_on_loopback() else ("",):
        if not is_free(shared, address, shared=True):
            raise InvalidInputError(
                f"UDP port {shared}, by which the nodes of {_DOMAIN} = {domain} find each other, "
                "is in use by another program: end that program, or choose another domain"
            )
    # Fast DDS tries the ports of 100 processes at most.
    own = range(port(domain, FIRST_PROCESS), 65_535, 2)[:100]
    if not any(is_free(first) and is_free(first + 1) for first in own):
        raise InvalidInputError(
            f"{_DOMAIN} = {domain} is refused: of its UDP ports, {own[0]} to {own[-1] + 1}, a node "
            "needs two that are free, and there are none: choose another domain"
        )


def _check_shared_memory() -> None:
    transports = os.environ.get(TRANSPORTS, "")
    if transports in ("", "NONE", "UDPv4", "UDPv6") or not SHARED_MEMORY.is_dir():
        return
    free = free_shared_memory()
    if free < _LEAST_SHARED_MEMORY:
        raise InvalidInputError(
            f"{TRANSPORTS} = {transports} lets Fast DDS use shared memory, and {SHARED_MEMORY} "
            f"has {free} bytes free, less than {_LEAST_SHARED_MEMORY}: unset it, or remove unused "
            "files there"
        )


def domain_of_environment() -> int:
    """Return the domain that the environment sets, by default 0.

    rcl itself reads -1 as 0, 1.5 as 1 and 010 as 8. Raises InvalidInputError.
    """
    text = os.environ.get(_DOMAIN, "").strip() or "0"
    if _DECIMAL.fullmatch(text) and int(text) <= _LARGEST_DOMAIN:
        return int(text)
    shown = text if _DECIMAL.fullmatch(text) else repr(text)
    raise InvalidInputError(
        f"{_DOMAIN} = {shown:.40} is refused: must be an integer from 0 to {_LARGEST_DOMAIN}, "
        "the last domain that has ports"
    )


def _reaches_itself() -> bool:
    kind = socket.AF_INET, socket.SOCK_DGRAM
    with socket.socket(*kind) as reader, socket.socket(*kind) as writer:
        reader.bind(("127.0.0.1", 0))
        reader.settimeout(1.0)
        try:
            writer.sendto(b"", reader.getsockname())
            reader.recv(1)
        except OSError:
            return False
    return True
