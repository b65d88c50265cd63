"""ROS in this process: from its initialisation to its end, and one node as a process."""

import argparse
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import cache
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from stickslip_ros.errors import InvalidInputError, StickslipError
from stickslip_ros.model.constants import Changes
from stickslip_ros.nodes.base import network
from stickslip_ros.nodes.base.child_process import die_with_parent
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.nodes.base.parameters import first_line
from stickslip_ros.nodes.base.spinner import Spinner, ignore_stop_signals, spin, stop_on_signals
from stickslip_ros.scenarios.parameter_group import NodeParameters
from stickslip_ros.scenarios.sections import read_file, section_matches
from stickslip_ros.standard_streams import open_closed_streams

ROS_ARGUMENTS = ["--ros-args", "--log-level", "warn", "--disable-external-lib-logs"]
"""ROS arguments of the commands, which use standard error and need no home directory."""

_NO_LOGS_ELSEWHERE = ("--disable-external-lib-logs", "--disable-rosout-logs")
"""No log files in the home directory, and no /rosout topic, of which each node name has one."""

_initialising = Lock()


@contextmanager
def ros_session(
    arguments: Sequence[str] = ROS_ARGUMENTS,
    *,
    context: Context | None = None,
    domain: int | None = None,
) -> Generator[Spinner]:
    """Initialise ROS without its signal handlers, and shut it down at the end.

    This uses the default context and the domain of the environment, unless others are given. The
    nodes that are added to the spinner are destroyed at the end.
    Raises InvalidInputError if the environment names no domain, or ROS refuses the arguments.
    """
    if domain is None:
        domain = network.domain_of_environment()
    try:
        rclpy.init(
            args=list(arguments),
            context=context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except Exception as error:  # its first line names the argument
        raise InvalidInputError(first_line(error)) from None
    try:
        with closing(Spinner(context)) as spinner:
            yield spinner
    finally:
        # Only without a named context can the default one be initialised again.
        rclpy.try_shutdown(context=None if context is rclpy.get_default_context() else context)


@contextmanager
def loopback_session(domain: int, arguments: Sequence[str]) -> Generator[Spinner]:
    """Initialise ROS in a domain, loopback only, with these global arguments; see `ros_session`.

    This uses rclpy's default context, so that nodes need not name it, unless it is already in use.
    """
    with ExitStack() as opened:
        with _initialising, network.environment({**_this_process_only_here(), **network.NO_PEERS}):
            context = Context() if rclpy.ok() else rclpy.get_default_context()
            session = ros_session([*arguments, *_NO_LOGS_ELSEWHERE], context=context, domain=domain)
            spinner = opened.enter_context(session)
        yield spinner


def run_node(make: Callable[[], ManagedNode[Any]], parameters: NodeParameters) -> int:
    """Run the node that `make` returns as a process, until SIGINT, SIGTERM or SIGHUP.

    `--help` prints the docstring of the module of `make`, and the `parameters`. Returns
    the exit status: 0 done, 1 the node failed, 2 a parameter or an argument was refused. The reason
    is printed on standard error.
    """
    open_closed_streams()
    parser = argparse.ArgumentParser(
        description=sys.modules[make.__module__].__doc__,
        epilog=_parameter_help(parameters),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--ros-args",
        metavar="...",
        help="ROS arguments: -p NAME:=VALUE, --params-file FILE, -r __ns:=/NAMESPACE, -r FROM:=TO",
    )
    die_with_parent()
    network.prefer_prompt_middleware()
    try:
        parser.parse_args(remove_ros_args(sys.argv)[1:])
    except Exception as error:
        print(f"{parser.prog}: {first_line(error)}", file=sys.stderr)
        return 2
    try:
        with ros_session(sys.argv) as spinner:
            node = make()
            _warn_of_unread_files(node)
            try:
                run_until_stopped(spinner, node)
            finally:  # `timeout` and `ros2 launch` send more than one
                ignore_stop_signals()
        return 0
    except StickslipError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 2 if isinstance(error, InvalidInputError) else 1


def run_until_stopped(spinner: Spinner, node: ManagedNode[Any]) -> None:
    """Run a node until a signal or the node ends this; raise the error that stopped it."""
    spinner.add(node)
    stop_on_signals(spinner.executor, node.stopped)
    spin(spinner.executor, node.stopped)
    if node.active:
        node.trigger_deactivate()
    reason = node.stopped.result()
    if reason is not None:
        raise reason


def _warn_of_unread_files(node: ManagedNode[Any]) -> None:
    """Log each parameter file of the command line that has no section for the node.

    ROS, which has read them, is silent about that.
    """
    name = node.get_fully_qualified_name()
    for option, path in pairwise(sys.argv):
        if option != "--params-file":
            continue
        with suppress(InvalidInputError):  # ROS accepts what a scenario file may not have
            sections = [pattern for pattern, _ in read_file(Path(path), "/").sections]
            if not any(section_matches(pattern, name) for pattern in sections):
                node.get_logger().warning(
                    f"{path} has no section for {name}; it has {', '.join(sections)}"
                )


@cache
def _this_process_only_here() -> Mapping[str, str]:
    """Return the environment variables that restrict ROS in this process to the loopback.

    Fast DDS reads a profile once per process. If ROS was in use before ours could be read, it
    listens on every address; then LOCALHOST, which uses shared memory, is the best available.
    """
    variables = network.this_machine_only()
    context, arguments = Context(), ["--ros-args", *_NO_LOGS_ELSEWHERE]
    with (
        network.own_domain() as domain,
        network.environment({**variables, network.DISCOVERY_RANGE: "OFF"}),
        ros_session(arguments, context=context, domain=domain) as spinner,
    ):
        spinner.add(Node("which_addresses", context=context))
        elsewhere_free = network.is_free(network.port(domain, network.FIRST_PROCESS), "127.0.0.2")
    return variables if elsewhere_free else {network.DISCOVERY_RANGE: "LOCALHOST"}


def _parameter_help(parameters: NodeParameters) -> str:
    lines = ["parameters:"]
    for parameter in parameters.known.values():
        unit, default = f" {parameter.unit}" if parameter.unit else "", parameter.default
        if parameter.unset:
            default, unit = parameter.unset, f";{unit}" if unit else ""
        bounds = f"; {parameter.bounds}" if parameter.bounds else ""
        when = "" if parameter.changes is Changes.LIVE else f"; set {parameter.changes}"
        lines.append(f"  {parameter.name}  (default {default}{unit}{bounds}{when})")
        lines.append(f"      {parameter.meaning}")
    return "\n".join(lines)
