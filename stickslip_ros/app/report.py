"""`stickslip report`: the measures of a recorded run."""

import argparse
from pathlib import Path

from stickslip_ros.app.arguments import add_json, seconds
from stickslip_ros.app.output import print_figures, print_json
from stickslip_ros.bags.report import report_of_bag
from stickslip_ros.versions import versions

NAME = "report"
HELP = "measure a recorded run"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag directory, or one .mcap file")
    parser.add_argument(
        "--from",
        dest="start",
        type=seconds,
        default=0.0,
        metavar="S",
        help="leave out what is before, s from the first sample (default: 0)",
    )
    parser.add_argument(
        "--to",
        dest="end",
        type=seconds,
        default=float("inf"),
        metavar="S",
        help="leave out what is after, s from the first sample (default: the end)",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    report = report_of_bag(arguments.bag, start=arguments.start, end=arguments.end)
    report |= {"bag": str(arguments.bag)}
    if arguments.json:
        print_json({**report, "versions": versions()})
    else:
        print_figures(str(arguments.bag), {"": report})
    return 0
