"""Network that ROS uses: set by the environment, or by the profiles beside this file."""

import os
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path

DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
NO_PEERS = {"ROS_STATIC_PEERS": ""}

_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_LOCALHOST_ONLY = "ROS_LOCALHOST_ONLY"
"""Predecessor of the range; it takes precedence."""


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


def _translate_predecessor() -> None:
    """Translate a setting of the range's predecessor into the range."""
    if os.environ.get(_LOCALHOST_ONLY) == "1":
        os.environ.update({DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""})


def _profile(name: str) -> str:
    return str(Path(__file__).with_name(f"{name}.xml"))
