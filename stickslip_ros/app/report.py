"""`stickslip report`: the measures of recorded runs."""

import argparse
from pathlib import Path

from stickslip_ros.app.arguments import length, seconds, speed
from stickslip_ros.app.recordings import add_reading, add_recordings, reading_of
from stickslip_ros.app.result import (
    add_results,
    check_results,
    is_drawn,
    print_result,
    write_results,
)
from stickslip_ros.errors import InvalidInputError

_MOST_DRAWN = 6
"""Bags that a figure can show, each in its own colour."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_recordings(
        parser,
        "bag directory, or one .mcap file; also one that is being recorded, cut off or damaged: "
        "the readable part is measured, and a sentence names what is missing. Or a table, as text "
        "or .mat: one of `stickslip simulate --out`, or any other with --columns",
    )
    parser.add_argument(
        "--stick-speed",
        type=speed,
        metavar="V",
        help="largest relative speed of a slide that sticks, m/s (default: as the analyzer used; "
        "for a table 0)",
    )
    parser.add_argument(
        "--slips",
        type=length,
        metavar="M",
        help="also find slips: drops of the position (or rises, if there are none) by more than "
        "this, m, one by one",
    )
    parser.add_argument(
        "--slip-time",
        type=seconds,
        default=0.1,
        metavar="S",
        help="longest time in which a slip drops by as much, s (default: 0.1)",
    )
    add_reading(parser)
    add_results(
        parser,
        "motion, force, cycles and friction law of a bag; of several bags motion and force side by "
        "side, their cycles and phase portraits in the same panels",
    )


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.recordings import Comparison, recorded_run
    from stickslip_ros.measures.slips import SlipThreshold
    from stickslip_ros.record.bag_files import runs_of
    from stickslip_ros.record.table_file import is_table

    bags: list[Path] = [*dict.fromkeys(arguments.recordings)]
    check_results(arguments)
    for option, path in (("--plot", arguments.plot), ("--html", arguments.html)):
        if path is not None and len(bags) > _MOST_DRAWN:
            raise InvalidInputError(
                f"{option} {path}: draws at most {_MOST_DRAWN} bags, and {len(bags)} were given"
            )
    reading = reading_of(arguments)
    if reading["columns"] is not None and not any(map(is_table, bags)):
        raise InvalidInputError(f"--columns {arguments.columns}: a bag has no columns")
    slips = None if arguments.slips is None else SlipThreshold(arguments.slips, arguments.slip_time)
    runs = [
        recorded_run(
            bag,
            stick_speed=arguments.stick_speed,
            slips=slips,
            kept=False,
            drawn=is_drawn(arguments),
            continued=continued,
            **reading,
        )
        for bag, continued in runs_of(bags).items()
    ]
    result = runs[0] if len(runs) == 1 else Comparison(tuple(runs))
    write_results(arguments, result)
    print_result(arguments, result)
