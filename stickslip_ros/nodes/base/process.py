"""Running nodes: one as a process, and the spinning that every executor here needs."""

import argparse
import os
import re
import signal
import socket
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.logging import get_logger
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from stickslip_ros.errors import InvalidInputError, StickslipError
from stickslip_ros.nodes import SHARED_MEMORY, free_shared_memory
from stickslip_ros.nodes.base.child_process import die_with_parent
from stickslip_ros.nodes.base.domain_ports import (
    DISCOVERY,
    FIRST_PROCESS,
    LARGEST_PORT,
    MOST_PROCESSES,
    is_free,
    port,
)
from stickslip_ros.nodes.base.managed import ManagedNode, first_line
from stickslip_ros.scenarios.parameter import parameters_of
from stickslip_ros.scenarios.parameters import NodeParameters
from stickslip_ros.stamps import END_OF_TIME, NANOSECONDS
from stickslip_ros.streams import open_closed_streams

ROS_ARGUMENTS = ["--ros-args", "--log-level", "warn", "--disable-external-lib-logs"]
"""Of the commands: they say on standard error what there is to say, and need no home directory."""

_DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_DISCOVERY_SERVER = "ROS_DISCOVERY_SERVER"
_LOCALHOST_ONLY = "ROS_LOCALHOST_ONLY"
"""The range's predecessor, which overrules it."""
_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_NO_PROFILES_FROM_HERE = "SKIP_DEFAULT_XML_FILE"
"""Set, it keeps Fast DDS from reading profiles of the working directory, which overrule others."""
_DOMAIN = "ROS_DOMAIN_ID"
_LARGEST_DOMAIN = 232
_DISCOVERY_ADDRESSES = ("127.0.0.1", "239.255.0.1")
"""On which Fast DDS listens where it is kept on this machine."""
_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
_WITHOUT_SHARED_MEMORY = ("", "NONE", "UDPv4", "UDPv6")
_LEAST_SHARED_MEMORY = 1 << 20
"""Bytes that a process of Fast DDS takes at most, rounded up."""
_DECIMAL = re.compile(r"0|[1-9][0-9]{0,20}")
_ECHO_TIMEOUT = 1.0
_SPIN_TIMEOUT = 0.2


def initialise() -> None:
    """Initialise ROS for a command, which handles the signals itself.

    Raises InvalidInputError for what the environment says amiss.
    """
    check_machine(_domain_of_environment())
    try:
        rclpy.init(args=ROS_ARGUMENTS, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:
        raise InvalidInputError(first_line(error)) from None


def run_node(make: Callable[[], ManagedNode[Any]], model: type[NodeParameters]) -> int:
    """Run one node as a process, until SIGINT, SIGTERM or SIGHUP; return the exit status.

    Status 2 says that a parameter or an argument was refused, with the reason on standard error.
    """
    open_closed_streams()
    parser = argparse.ArgumentParser(
        description=sys.modules[make.__module__].__doc__,
        epilog=_parameter_help(model),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--ros-args",
        metavar="...",
        help="ROS arguments: -p NAME:=VALUE, --params-file FILE, -r __ns:=/NAMESPACE, -r FROM:=TO",
    )
    die_with_parent()
    prefer_prompt_middleware()
    try:
        parser.parse_args(remove_ros_args(sys.argv)[1:])
        check_machine(_domain_of_environment())
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # what rcl could not parse; its first line names it
        print(f"{parser.prog}: {first_line(error)}", file=sys.stderr)
        return 2
    try:
        run_until_stopped(make())
        return 0
    except InvalidInputError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 2
    except StickslipError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()


def run_until_stopped(node: ManagedNode[Any]) -> None:
    """Run a node until a signal or it itself ends that; raise what it was stopped with."""
    executor = EventsExecutor()
    executor.add_node(node)
    stop_on_signals(executor, node.stopped)
    spin(executor, node.stopped)
    if node.active:
        node.trigger_deactivate()
    reason = node.stopped.result()
    executor.remove_node(node)
    node.destroy_node()
    executor.shutdown()
    if reason is not None:
        raise reason


def keep_on_this_machine(network: bool) -> str:
    """Restrict ROS to this machine, or open it; return in words what holds.

    To be called before ROS is initialised. What the environment says holds, unless `network` asks
    for more.
    """
    _heed_predecessor()
    names = [_DISCOVERY_RANGE, *([_DISCOVERY_SERVER, _PROFILES] if _is_fast_dds() else [])]
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
    if not _is_fast_dds():
        return {_DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""}
    return {
        # LOCALHOST, of either name, would overrule the profile, and take shared memory.
        _DISCOVERY_RANGE: "SYSTEM_DEFAULT",
        _LOCALHOST_ONLY: "",
        _PROFILES: _profile("loopback"),
        _NO_PROFILES_FROM_HERE: "1",
    }


def check_machine(domain: int) -> None:
    """Raise InvalidInputError where nodes could not live: for the domain, the clock, the network.

    What the middleware itself says of these is no sentence, or nothing.
    """
    if domain > _LARGEST_DOMAIN:
        raise _domain_refused(domain)
    now = time.time_ns()
    if not 0 < now < END_OF_TIME:
        year = datetime.fromtimestamp(now / NANOSECONDS, UTC).year
        raise InvalidInputError(
            f"the clock of this machine says {year}: the stamps of ROS messages reach from 1970 "
            "to January 2038"
        )
    if os.environ.get(_PROFILES) == _profile("loopback") and not _reaches_itself():
        raise InvalidInputError(
            "the loopback interface of this machine is down, and nodes that are kept on it need "
            "that: ip link set lo up"
        )
    if _is_fast_dds():
        _check_ports(domain)
        _check_shared_memory()


def _check_ports(domain: int) -> None:
    kept_here = os.environ.get(_PROFILES) == _profile("loopback")
    shared = port(domain, DISCOVERY)
    for address in _DISCOVERY_ADDRESSES if kept_here else ("",):
        if not is_free(shared, address, shared=True):
            raise InvalidInputError(
                f"UDP port {shared}, by which the nodes of {_DOMAIN} = {domain} find each other, "
                "is taken by another program: end that, or choose another domain"
            )
    own = range(port(domain, FIRST_PROCESS), LARGEST_PORT, 2)[:MOST_PROCESSES]
    if not any(is_free(first) and is_free(first + 1) for first in own):
        raise InvalidInputError(
            f"{_DOMAIN} = {domain} is refused: of its UDP ports, {own[0]} to {own[-1] + 1}, a node "
            "needs two that are free, and there are none: choose another domain"
        )


def _check_shared_memory() -> None:
    transports = os.environ.get(_TRANSPORTS, "")
    if transports in _WITHOUT_SHARED_MEMORY or not SHARED_MEMORY.is_dir():
        return
    free = free_shared_memory()
    if free < _LEAST_SHARED_MEMORY:
        raise InvalidInputError(
            f"{_TRANSPORTS} = {transports} lets Fast DDS use shared memory, and {SHARED_MEMORY} "
            f"has {free} bytes free, less than {_LEAST_SHARED_MEMORY}: unset it, or remove what is "
            "left there"
        )


def _domain_of_environment() -> int:
    """Return the domain that the environment says, without which it is 0.

    rcl would take -1 for 0, 1.5 for 1 and 010 for 8. Raises InvalidInputError.
    """
    text = os.environ.get(_DOMAIN, "").strip() or "0"
    if not _DECIMAL.fullmatch(text):
        raise _domain_refused(repr(text))
    return int(text)


def _domain_refused(domain: object) -> InvalidInputError:
    return InvalidInputError(
        f"{_DOMAIN} = {domain!s:.40} is refused: must be an integer from 0 to {_LARGEST_DOMAIN}, "
        "the last domain that has ports"
    )


def _reaches_itself() -> bool:
    kind = socket.AF_INET, socket.SOCK_DGRAM
    with socket.socket(*kind) as reader, socket.socket(*kind) as writer:
        reader.bind(("127.0.0.1", 0))
        reader.settimeout(_ECHO_TIMEOUT)
        try:
            writer.sendto(b"", reader.getsockname())
            reader.recv(1)
        except OSError:
            return False
    return True


def prefer_prompt_middleware() -> None:
    """Let Fast DDS do without shared memory and send soon again, if the environment says nothing.

    In shared memory a reader that is stopped or killed delays everybody who publishes to it, by
    half a millisecond each time and by seconds now and then.
    """
    _heed_predecessor()
    if any(os.environ.get(name) for name in (_PROFILES, _TRANSPORTS)):
        return
    if os.environ.get(_DISCOVERY_RANGE) == "LOCALHOST":
        os.environ.update(this_machine_only())
    else:
        os.environ[_PROFILES] = _profile("network")


def _is_fast_dds() -> bool:
    return "fastrtps" in rclpy.get_rmw_implementation_identifier()


def _heed_predecessor() -> None:
    """Put what the environment says by the range's predecessor in terms of the range."""
    if os.environ.get(_LOCALHOST_ONLY) == "1":
        os.environ.update({_DISCOVERY_RANGE: "LOCALHOST", _LOCALHOST_ONLY: ""})


def _profile(name: str) -> str:
    return str(Path(__file__).with_name(f"{name}.xml"))


def stop_on_signals(executor: Executor, *stopped: Future) -> dict[signal.Signals, Any]:
    """Let each SIGINT, SIGTERM or SIGHUP complete the next of `stopped` with None.

    Where SIGHUP is ignored, as under nohup, it still is. Return the handlers there were.
    """

    def stop(*_: object) -> None:
        due = next((future for future in stopped if not future.done()), None)
        if due is not None:
            due.set_result(None)
            executor.wake()

    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    return {number: signal.signal(number, stop) for number in numbers}


def spin(executor: Executor, until: Future) -> None:
    """Run callbacks until the future is done; one that raises is logged, and the rest go on."""
    while not until.done():
        try:
            executor.spin_until_future_complete(until, timeout_sec=_SPIN_TIMEOUT)
        except Exception as error:  # an impossible request from outside ends up here, too
            get_logger("stickslip_ros").error(f"{type(error).__name__}: {error}")


def _parameter_help(model: type[NodeParameters]) -> str:
    lines = ["parameters:"]
    for parameter in parameters_of(model):
        unit = f" {parameter.unit}" if parameter.unit else ""
        bounds = f"; {parameter.bounds}" if parameter.bounds else ""
        when = f"; set {parameter.fixed.changes}" if parameter.fixed else ""
        lines.append(f"  {parameter.name}  (default {parameter.default}{unit}{bounds}{when})")
        lines.append(f"      {parameter.meaning}")
    return "\n".join(lines)
