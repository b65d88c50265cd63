"""`stickslip report`: the measures of recorded runs."""

import argparse
from pathlib import Path

from stickslip_ros.app.arguments import add_json, seconds
from stickslip_ros.app.output import print_figures, print_json
from stickslip_ros.bags.report import report_of_bag
from stickslip_ros.printable import printable
from stickslip_ros.versions import versions

HELP = "measure a recorded run, or set several side by side"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "bags",
        metavar="BAG",
        nargs="+",
        type=Path,
        help="bag directory, or one .mcap file; also one that is still recorded, cut off or "
        "damaged: what is left of it is measured, and what is missing said",
    )
    parser.add_argument(
        "--from",
        dest="start",
        type=seconds,
        default=0.0,
        metavar="S",
        help="leave out what is before, s from the first sample of each bag (default: 0)",
    )
    parser.add_argument(
        "--to",
        dest="end",
        type=seconds,
        default=float("inf"),
        metavar="S",
        help="leave out what is after, s from the first sample of each bag (default: the end)",
    )
    parser.add_argument(
        "--namespace",
        metavar="NS",
        help="ROS namespace of the drive, where a bag holds several",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    reports = {
        str(bag): report_of_bag(
            bag, start=arguments.start, end=arguments.end, namespace=arguments.namespace
        )
        for bag in arguments.bags
    }
    if arguments.json:
        results = [{**report, "bag": bag} for bag, report in reports.items()]
        result = results[0] if len(results) == 1 else {"reports": results}
        print_json({**result, "versions": versions()})
        return 0
    several = len(reports) > 1
    print_figures(
        "" if several else str(arguments.bags[0]),
        {bag if several else "": report for bag, report in reports.items()},
    )
    for bag, report in reports.items():
        for sentence in [*report["missing"], *report["notes"]]:
            print(printable(f"{bag}: {sentence}") if several else sentence)
    return 0
