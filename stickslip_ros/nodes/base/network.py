"""Where ROS is heard: the reach of its network, and domains, namespaces and ports of this machine.

The network is set by the environment, or by the profiles beside this file. Importing this module
does not load ROS.
"""

import errno
import os
import re
import socket
import struct
import sys
import time
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

from stickslip_ros.errors import InvalidInputError, RunError

DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
NO_PEERS = {"ROS_STATIC_PEERS": ""}

_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_LOCALHOST_ONLY = "ROS_LOCALHOST_ONLY"
"""Predecessor of the range; it takes precedence."""

DOMAINS = range(1, 102)
"""Domains whose ports are all below the ephemeral ports of the system."""
FIRST_PROCESS = 10
"""Number in the domain of the first port that belongs to one process; each process has two."""

_DOMAIN = "ROS_DOMAIN_ID"
_LARGEST_DOMAIN = 232
_DECIMAL = re.compile(r"0|[1-9][0-9]{0,20}")


def keep_on_this_machine(network: bool) -> str:
    """Restrict ROS to this machine, or open it to the network; return the result in words.

    Call this before ROS is initialised. Settings of the environment take precedence, unless
    `network` asks for more.
    """
    _translate_predecessor()
    names = [DISCOVERY_RANGE, *(["ROS_DISCOVERY_SERVER", _PROFILES] if is_fast_dds() else [])]
    given = [f"{name}={os.environ[name]}" for name in names if os.environ.get(name)]
    if network:
        os.environ[DISCOVERY_RANGE] = "SUBNET"
    elif not given:
        os.environ.update(this_machine_only())
    prefer_prompt_middleware()
    if network:
        return "open to the network"
    if this_machine_only().items() <= os.environ.items():
        return "loopback only"
    return f"set by the environment: {' '.join(given)}"


def this_machine_only() -> dict[str, str]:
    """Return the environment variables that restrict ROS to the loopback."""
    if not is_fast_dds():
        return {DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""}
    return {
        # LOCALHOST, by either name, would override the profile and use shared memory.
        DISCOVERY_RANGE: "SYSTEM_DEFAULT",
        _LOCALHOST_ONLY: "",
        _PROFILES: _profile("loopback"),
        # Profiles in the working directory would override this one.
        "SKIP_DEFAULT_XML_FILE": "1",
    }


def domain_variables(domain: int) -> dict[str, str]:
    """Return the environment variables of a process for a domain, loopback only."""
    return {**this_machine_only(), **NO_PEERS, "ROS_DOMAIN_ID": str(domain)}


def prefer_prompt_middleware() -> None:
    """Make Fast DDS use no shared memory and resend quickly, unless the environment sets it up.

    In shared memory, a reader that is stopped or killed delays all its writers, by half a
    millisecond each time and sometimes by seconds.
    """
    _translate_predecessor()
    if any(os.environ.get(name) for name in (_PROFILES, "FASTDDS_BUILTIN_TRANSPORTS")):
        return
    if os.environ.get(DISCOVERY_RANGE) == "LOCALHOST":
        os.environ.update(this_machine_only())
    else:
        os.environ[_PROFILES] = _profile("network")


def is_fast_dds() -> bool:
    """Return whether ROS uses Fast DDS here."""
    import rclpy  # not everybody who imports this module needs ROS

    return "fastrtps" in rclpy.get_rmw_implementation_identifier()


@contextmanager
def environment(variables: Mapping[str, str]) -> Generator[None]:
    """Set environment variables for a time."""
    before = {name: os.environ[name] for name in variables if name in os.environ}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables:
            del os.environ[name]
        os.environ.update(before)


class NamespaceInUseError(InvalidInputError):
    """Another run is in the namespace."""


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


def is_free(taken: int, address: str = "") -> bool:
    """Return whether a UDP port of an address is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, taken))
        except OSError as error:
            return error.errno != errno.EADDRINUSE
    return True


def _translate_predecessor() -> None:
    """Translate a setting of the range's predecessor into the range."""
    if os.environ.get(_LOCALHOST_ONLY) == "1":
        os.environ.update({DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""})


def _profile(name: str) -> str:
    return str(Path(__file__).with_name(f"{name}.xml"))


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
