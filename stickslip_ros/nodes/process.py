"""Running nodes: one as a process, and the spinning that every executor here needs."""

import argparse
import os
import signal
import sys
from collections.abc import Callable
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
from stickslip_ros.nodes.lifeline import die_with_parent
from stickslip_ros.nodes.managed import ManagedNode
from stickslip_ros.scenario.parameters import NodeParameters, parameters_of

_DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_SPIN_TIMEOUT = 0.2


def run_node(make: Callable[[], ManagedNode[Any]], model: type[NodeParameters]) -> int:
    """Run one node as a process, until SIGINT or SIGTERM; return the exit status.

    Status 2 says that a parameter or an argument was refused, with the reason on standard error.
    """
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
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # what rcl could not parse; its first line names it
        print(f"{parser.prog}: {_first_line(error)}", file=sys.stderr)
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
    """Run a node until SIGINT, SIGTERM or it itself ends that; raise what it was stopped with."""
    executor = EventsExecutor()
    executor.add_node(node)
    stop_on_signals(node.stopped, executor)
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
    names = (_DISCOVERY_RANGE, *_PROFILES)
    said = [f"{name}={os.environ[name]}" for name in names if name in os.environ]
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
    if "fastrtps" not in rclpy.get_rmw_implementation_identifier():
        return {_DISCOVERY_RANGE: "LOCALHOST"}
    # LOCALHOST would overrule the profile, and take shared memory.
    return {_DISCOVERY_RANGE: "SYSTEM_DEFAULT", _PROFILES[0]: _profile("loopback")}


def prefer_prompt_middleware() -> None:
    """Let Fast DDS do without shared memory and send soon again, if the environment says nothing.

    In shared memory a reader that is stopped or killed delays everybody who publishes to it, by
    half a millisecond each time and by seconds now and then.
    """
    if any(name in os.environ for name in (*_PROFILES, "FASTDDS_BUILTIN_TRANSPORTS")):
        return
    if os.environ.get(_DISCOVERY_RANGE) == "LOCALHOST":
        os.environ.update(this_machine_only())
    else:
        os.environ[_PROFILES[0]] = _profile("network")


def _profile(name: str) -> str:
    return str(Path(__file__).with_name(f"{name}.xml"))


def stop_on_signals(stopped: Future, executor: Executor) -> dict[signal.Signals, Any]:
    """Let SIGINT and SIGTERM complete `stopped` with None; return the handlers there were."""

    def stop(*_: object) -> None:
        if not stopped.done():
            stopped.set_result(None)
            executor.wake()

    return {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}


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
        lines.append(f"  {parameter.name}  (default {parameter.default}{unit}{bounds})")
        lines.append(f"      {parameter.meaning}")
    return "\n".join(lines)


def _first_line(error: Exception) -> str:
    return str(error).strip().split("\n", 1)[0].split(", at ", 1)[0]
