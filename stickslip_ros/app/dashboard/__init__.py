"""`stickslip dashboard`: a live web page that shows and controls a running loop."""

import argparse
import os
import socket
from contextlib import suppress
from pathlib import Path

from stickslip_ros.app.arguments import add_namespace, add_network, namespace_of, whole
from stickslip_ros.app.optional_dependencies import check_dashboard, loading_ros
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.nodes.base.child_process import die_with_parent
from stickslip_ros.text import printable

HOST = "127.0.0.1"
"""Address of the page: loopback only."""

DEFAULT_PORT = 8642
"""First port that is tried by default."""

LARGEST_PORT = 65_535


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_namespace(parser)
    parser.add_argument(
        "--port",
        type=whole("a port, {} to {}", 1, LARGEST_PORT),
        metavar="PORT",
        help=f"port of the page, loopback only (default: {DEFAULT_PORT}, or the next free one)",
    )
    parser.add_argument(
        "--read",
        action="append",
        default=[],
        metavar="PATH",
        help="bag of the run, to show and offer at its end, or file that a parameter of the plant "
        "names; of what nodes name, nothing else is read (repeatable)",
    )
    parser.add_argument(
        "--command", default="", help="command that started the run, for titles and for its end"
    )
    add_network(parser, "also listen to nodes on other machines; the page stays loopback only")


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    namespace = namespace_of(arguments.namespace)
    check_dashboard()
    with loading_ros():
        from stickslip_ros.nodes.base.network import keep_on_this_machine

        reach = keep_on_this_machine(arguments.network)
    die_with_parent()
    with suppress(OSError):
        os.nice(10)  # the simulation has priority
    listening = _listen(arguments.port)
    os.environ["MATPLOTLIB"] = "false"  # NiceGUI would import it
    from stickslip_ros.app.dashboard.server import serve  # needs NiceGUI and takes seconds

    readable = {*arguments.read, *(str(Path(path).resolve()) for path in arguments.read)}
    serve(namespace, listening, reach, readable, printable(arguments.command))


def _listen(port: int | None) -> socket.socket:
    """Return a socket that listens at the port, or at the first free one from the default on."""
    ports = range(DEFAULT_PORT, LARGEST_PORT + 1) if port is None else [port]
    reason = ""
    for number in ports:
        try:
            return socket.create_server((HOST, number))
        except OSError as error:
            reason = error.strerror
    tried = f"--port {port}" if port is not None else f"every port from {ports[0]} to {ports[-1]}"
    raise InvalidInputError(f"{tried}: {reason}")
