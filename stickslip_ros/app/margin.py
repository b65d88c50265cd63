"""`stickslip margin`: how far a machine is from chatter."""

import argparse
from pathlib import Path

from stickslip_ros.app.arguments import (
    add_bag_layout,
    add_columns,
    add_json,
    add_part,
    columns_of,
    form_of,
    layout_of,
)
from stickslip_ros.app.result import add_html, add_plot, check_results, give_result


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "recordings",
        metavar="RECORDING",
        nargs="+",
        type=Path,
        help="bag, or table (text, .mat) with --columns; of one machine, at several feeds",
    )
    add_columns(parser)
    parser.add_argument(
        "--margin",
        type=float,
        default=0.1,
        metavar="SHARE",
        help="share of the belt speed by which it is to exceed the onset (default: %(default)g)",
    )
    add_part(parser)
    add_bag_layout(parser)
    add_plot(parser, "decay rates over the belt speed, extrapolated to the onset")
    add_html(parser)
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.margin import margin

    check_results(arguments)
    names = "margin", "rotary", "start", "end", "namespace", "belt_speed"
    found = margin(
        *arguments.recordings,
        columns=columns_of(arguments.columns),
        **{name: getattr(arguments, name) for name in names},
        **vars(form_of(arguments)),
        **vars(layout_of(arguments)),
    )
    give_result(arguments, found)
