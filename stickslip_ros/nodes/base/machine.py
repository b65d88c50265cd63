"""Conditions of ROS on this machine: memory, the clock, ports, a domain, a namespace of its own.

Importing this module does not load ROS.
"""

import errno
import os
import re
import socket
import struct
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.nodes.base.network import TRANSPORTS, is_fast_dds, is_kept_on_loopback
from stickslip_ros.stamps import END_OF_TIME, NANOSECONDS

DOMAINS = range(1, 102)
"""Domains whose ports are all below the ephemeral ports of the system."""
FIRST_PROCESS = 10
"""Number in the domain of the first port that belongs to one process; each process has two."""

_DOMAIN = "ROS_DOMAIN_ID"
_LARGEST_DOMAIN = 232
_DECIMAL = re.compile(r"0|[1-9][0-9]{0,20}")
_SHARED_MEMORY = Path("/dev/shm")
_LEAST_SHARED_MEMORY = 1 << 20
"""Bytes that a process of Fast DDS uses at most, rounded up."""
_TRACING_FILES = 2
"""Files of one page each that the tracing library of ROS writes when it is loaded."""


class NamespaceInUseError(InvalidInputError):
    """Another run is in the namespace."""


def check_shared_memory() -> None:
    """Raise RunError if loading ROS would end this process by SIGBUS."""
    least = _TRACING_FILES * os.sysconf("SC_PAGESIZE")
    if not _SHARED_MEMORY.is_dir() or _free_shared_memory() >= least:
        return
    written = [
        file for file in _SHARED_MEMORY.glob("lttng-ust-wait-*") if file.stat().st_blocks > 0
    ]
    if len(written) < _TRACING_FILES:
        raise RunError(
            f"shared memory is full: {_SHARED_MEMORY} has {_free_shared_memory()} bytes free, and "
            f"ROS needs {least} to load; remove unused files there"
        )


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


def domain_of_environment() -> int:
    """Return the domain that the environment sets, by default 0.

    rcl itself reads -1 as 0, 1.5 as 1 and 010 as 8. Raises InvalidInputError.
    """
    text = os.environ.get(_DOMAIN, "").strip() or "0"
    if _DECIMAL.fullmatch(text) and int(text) <= _LARGEST_DOMAIN:
        return int(text)
    shown = text if _DECIMAL.fullmatch(text) else repr(text)
    raise InvalidInputError(
        f"{_DOMAIN} = {shown:.40} is invalid: must be an integer from 0 to {_LARGEST_DOMAIN}, "
        "the last domain that has ports"
    )


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
        If no domain becomes free within 10 s.

    Examples
    --------
    >>> from stickslip_ros.testing import own_domain
    >>> with own_domain() as first, own_domain() as second:
    ...     first != second
    True
    """
    for _ in range(100):
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
        time.sleep(0.1)
    raise RunError(f"every ROS domain from {DOMAINS[0]} to {DOMAINS[-1]} is in use on this machine")


@contextmanager
def lock_namespace(namespace: str, domain: int) -> Generator[None]:
    """Hold a namespace of a ROS domain on this machine; the end of this process frees it.

    Two plants on one topic would disturb each other.
    Raises NamespaceInUseError if another process of any user holds it. Linux only; on other
    systems, and in a sandbox that refuses such addresses, this does nothing.
    """
    if sys.platform != "linux":
        yield
        return
    # An abstract address leaves no file behind; containers share it if they share a network.
    address = f"\0stickslip_ros {sha256(f'{domain} {namespace}'.encode()).hexdigest()}"
    with socket.socket(socket.AF_UNIX) as held:
        try:
            held.bind(address)
            held.listen()
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise NamespaceInUseError(
                    f"the namespace {namespace} of the ROS domain {domain} is in use by another "
                    f"run{_holder(address)}"
                ) from None
        yield


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
    if transports in ("", "NONE", "UDPv4", "UDPv6") or not _SHARED_MEMORY.is_dir():
        return
    free = _free_shared_memory()
    if free < _LEAST_SHARED_MEMORY:
        raise InvalidInputError(
            f"{TRANSPORTS} = {transports} lets Fast DDS use shared memory, and {_SHARED_MEMORY} "
            f"has {free} bytes free, less than {_LEAST_SHARED_MEMORY}: unset it, or remove unused "
            "files there"
        )


def _free_shared_memory() -> int:
    found = os.statvfs(_SHARED_MEMORY)
    return found.f_bavail * found.f_frsize


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


def _holder(address: str) -> str:
    """Return the process that holds an address, in words; empty if it is unknown."""
    with socket.socket(socket.AF_UNIX) as asking, suppress(OSError):
        asking.settimeout(1.0)
        asking.connect(address)
        layout = "3i"
        length = struct.calcsize(layout)
        credentials = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, length)
        process, _, _ = struct.unpack(layout, credentials)
        if process:  # otherwise it is in another container
            return f" (process {process})"
    return ""
