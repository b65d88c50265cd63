"""`stickslip margin`: how far a machine is from chatter."""

import argparse

from stickslip_ros.app.recordings import add_reading, add_recordings, reading_of
from stickslip_ros.app.result import add_results, check_results, give_result


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_recordings(
        parser, "bag, or table (text, .mat) with --columns; of one machine, at several feeds"
    )
    parser.add_argument(
        "--margin",
        type=float,
        default=0.1,
        metavar="SHARE",
        help="share of the belt speed by which it is to exceed the onset (default: %(default)g)",
    )
    add_reading(parser)
    add_results(parser, "decay rates over the belt speed, extrapolated to the onset")


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.margin import margin

    check_results(arguments)
    result = margin(*arguments.recordings, margin=arguments.margin, **reading_of(arguments))
    give_result(arguments, result)
