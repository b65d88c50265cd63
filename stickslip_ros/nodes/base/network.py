"""Which network ROS uses: as the environment says, or by the profiles beside this file."""

import os
from pathlib import Path

import rclpy

TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
"""Variable that names the transports of Fast DDS."""

_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_LOCALHOST_ONLY = "ROS_LOCALHOST_ONLY"
"""The range's predecessor, which overrules it."""


def keep_on_this_machine(network: bool) -> str:
    """Restrict ROS to this machine, or open it; return in words what holds.

    To be called before ROS is initialised. What the environment says holds, unless `network` asks
    for more.
    """
    _heed_predecessor()
    names = [_DISCOVERY_RANGE, *(["ROS_DISCOVERY_SERVER", _PROFILES] if is_fast_dds() else [])]
    said = [f"{name}={os.environ[name]}" for name in names if os.environ.get(name)]
    if network:
        os.environ[_DISCOVERY_RANGE] = "SUBNET"
    elif not said:
        os.environ.update(this_machine_only())
    prefer_prompt_middleware()
    if network:
        return "open to the network"
    if this_machine_only().items() <= os.environ.items():
        return "kept on this machine"
    return f"as the environment says: {' '.join(said)}"


def this_machine_only() -> dict[str, str]:
    """Return the environment variables that restrict ROS to this machine."""
    if not is_fast_dds():
        return {_DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""}
    return {
        # LOCALHOST, of either name, would overrule the profile, and take shared memory.
        _DISCOVERY_RANGE: "SYSTEM_DEFAULT",
        _LOCALHOST_ONLY: "",
        _PROFILES: _profile("loopback"),
        # Profiles of the working directory would overrule this one.
        "SKIP_DEFAULT_XML_FILE": "1",
    }


def prefer_prompt_middleware() -> None:
    """Let Fast DDS do without shared memory and send soon again, if the environment says nothing.

    In shared memory a reader that is stopped or killed delays everybody who publishes to it, by
    half a millisecond each time and by seconds now and then.
    """
    _heed_predecessor()
    if any(os.environ.get(name) for name in (_PROFILES, TRANSPORTS)):
        return
    if os.environ.get(_DISCOVERY_RANGE) == "LOCALHOST":
        os.environ.update(this_machine_only())
    else:
        os.environ[_PROFILES] = _profile("network")


def is_kept_on_loopback() -> bool:
    """Return whether the environment says what `this_machine_only` does to Fast DDS."""
    return os.environ.get(_PROFILES) == _profile("loopback")


def is_fast_dds() -> bool:
    """Return whether ROS uses Fast DDS here."""
    return "fastrtps" in rclpy.get_rmw_implementation_identifier()


def _heed_predecessor() -> None:
    """Put what the environment says by the range's predecessor in terms of the range."""
    if os.environ.get(_LOCALHOST_ONLY) == "1":
        os.environ.update({_DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""})


def _profile(name: str) -> str:
    return str(Path(__file__).with_name(f"{name}.xml"))
