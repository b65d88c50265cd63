"""Network that ROS uses: set by the environment, or by the profiles beside this file."""

import os
from pathlib import Path

import rclpy

TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
"""Variable that names the transports of Fast DDS."""

_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_LOCALHOST_ONLY = "ROS_LOCALHOST_ONLY"
"""Predecessor of the range; it takes precedence."""


def keep_on_this_machine(network: bool) -> str:
    """Restrict ROS to this machine, or open it to the network; return the result in words.

    Call this before ROS is initialised. Settings of the environment take precedence, unless
    `network` asks for more.
    """
    _translate_predecessor()
    names = [_DISCOVERY_RANGE, *(["ROS_DISCOVERY_SERVER", _PROFILES] if is_fast_dds() else [])]
    given = [f"{name}={os.environ[name]}" for name in names if os.environ.get(name)]
    if network:
        os.environ[_DISCOVERY_RANGE] = "SUBNET"
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
        return {_DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""}
    return {
        # LOCALHOST, by either name, would override the profile and use shared memory.
        _DISCOVERY_RANGE: "SYSTEM_DEFAULT",
        _LOCALHOST_ONLY: "",
        _PROFILES: _profile("loopback"),
        # Profiles in the working directory would override this one.
        "SKIP_DEFAULT_XML_FILE": "1",
    }


def prefer_prompt_middleware() -> None:
    """Make Fast DDS use no shared memory and resend quickly, unless the environment sets it up.

    In shared memory, a reader that is stopped or killed delays all its writers, by half a
    millisecond each time and sometimes by seconds.
    """
    _translate_predecessor()
    if any(os.environ.get(name) for name in (_PROFILES, TRANSPORTS)):
        return
    if os.environ.get(_DISCOVERY_RANGE) == "LOCALHOST":
        os.environ.update(this_machine_only())
    else:
        os.environ[_PROFILES] = _profile("network")


def is_kept_on_loopback() -> bool:
    """Return whether the environment has the settings of `this_machine_only` for Fast DDS."""
    return os.environ.get(_PROFILES) == _profile("loopback")


def is_fast_dds() -> bool:
    """Return whether ROS uses Fast DDS here."""
    return "fastrtps" in rclpy.get_rmw_implementation_identifier()


def _translate_predecessor() -> None:
    """Translate a setting of the range's predecessor into the range."""
    if os.environ.get(_LOCALHOST_ONLY) == "1":
        os.environ.update({_DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""})


def _profile(name: str) -> str:
    return str(Path(__file__).with_name(f"{name}.xml"))
