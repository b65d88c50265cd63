"""`stickslip dashboard`: a live web page that shows and controls a running loop."""

import argparse
import os
from contextlib import suppress
from pathlib import Path

from stickslip_ros.app.arguments import add_namespace, add_network, namespace_of, whole
from stickslip_ros.app.optional_dependencies import check_dashboard, load_matplotlib, loading_ros
from stickslip_ros.nodes.base.child_process import die_with_parent
from stickslip_ros.text import printable

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
    load_matplotlib()
    from stickslip_ros.app.dashboard.server import serve  # needs NiceGUI and takes seconds

    readable = {*arguments.read, *(str(Path(path).resolve()) for path in arguments.read)}
    serve(namespace, arguments.port, reach, readable, printable(arguments.command))
