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
from stickslip_ros.app.result import (
    add_html,
    add_plot,
    check_results,
    print_result,
    write_results,
)

_DESCRIPTION = """Tell the belt speed at which vibration starts, with a 95 % interval, from runs at
several feeds that do not vibrate. Taps on the slide, or steps of the feed, excite it; the decay of
what follows is measured at each feed, and extrapolated to zero by all families of friction laws
that fit. Where it cannot be told, a sentence says which run would tell it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
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
        help="share of the belt speed by which it is to exceed the onset (default: %(default)g): "
        "the least feed that keeps it is printed",
    )
    add_part(parser)
    add_bag_layout(parser)
    add_plot(parser, "decay rates over the belt speed, extrapolated to the onset")
    add_html(parser)
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.margin import margin

    columns = columns_of(arguments.columns)
    check_results(arguments)
    found = margin(
        *arguments.recordings,
        columns=columns,
        margin=arguments.margin,
        start=arguments.start,
        end=arguments.end,
        namespace=arguments.namespace,
        belt_speed=arguments.belt_speed,
        **vars(form_of(arguments)),
        **vars(layout_of(arguments)),
        rotary=arguments.rotary,
    )
    print_result(arguments, found)
    write_results(arguments, found)
