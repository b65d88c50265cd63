"""`stickslip dashboard`: a web page that shows a running loop, and acts on it."""

import argparse
import os
from contextlib import suppress

from stickslip_ros.app.arguments import add_namespace, add_network, namespace_of
from stickslip_ros.app.optional_dependencies import check_dashboard, loading_ros
from stickslip_ros.nodes.base.child_process import die_with_parent

HELP = "show a running loop on a web page, live, and act on it"

DEFAULT_PORT = 8642
"""The first that is tried where none is asked for."""

LARGEST_PORT = 65_535


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_namespace(parser)
    parser.add_argument(
        "--port",
        type=_port,
        metavar="PORT",
        help=f"port of the page on this machine (default: {DEFAULT_PORT}, or the next free one)",
    )
    add_network(parser, "listen to nodes on other machines, too; the page stays on this one")


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    namespace = namespace_of(arguments.namespace)
    check_dashboard()
    with loading_ros():
        from stickslip_ros.nodes.base.network import keep_on_this_machine
    reach = keep_on_this_machine(arguments.network)
    die_with_parent()
    with suppress(OSError):
        os.nice(10)  # the simulation goes first
    from stickslip_ros.app.dashboard.server import serve  # it needs NiceGUI, and takes seconds

    serve(namespace, arguments.port, reach)
    return 0


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= LARGEST_PORT):
        raise argparse.ArgumentTypeError(f"{text!r} is not a port, 1 to {LARGEST_PORT}")
    return int(text)
