"""`stickslip repair`: a sound bag from a damaged one."""

import argparse
from pathlib import Path

from stickslip_ros.app.arguments import add_json
from stickslip_ros.app.output import print_json, print_parts, progress_bar
from stickslip_ros.tables import TextTable


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "bag",
        metavar="BAG",
        type=Path,
        help="bag directory, or one .mcap file, such as a killed recorder leaves; it is "
        "not changed",
    )
    parser.add_argument(
        "out", metavar="OUT", type=Path, help="directory for the sound bag; must not exist"
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.record.repair import repair

    with progress_bar(f"repairing {arguments.bag}", None) as progress:
        repaired = repair(arguments.bag, arguments.out, progress)
    if arguments.json:
        print_json(
            {
                "bag": str(arguments.bag),
                "out": str(arguments.out),
                "messages": dict(repaired.messages),
                "missing": repaired.missing,
            }
        )
        return
    rows = [[topic, str(count)] for topic, count in sorted(repaired.messages.items())]
    table = TextTable(str(arguments.out), ["topic", "messages"], rows)
    print_parts(table, *(repaired.missing or ["nothing was missing"]))
