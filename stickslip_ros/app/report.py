"""`stickslip report`: the measures of recorded runs."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import (
    add_columns,
    add_json,
    add_part,
    add_plot,
    check_figure,
    columns_of,
    length,
    seconds,
    speed,
    write_figure,
)
from stickslip_ros.app.output import print_json, print_parts
from stickslip_ros.errors import InvalidInputError

if TYPE_CHECKING:
    from stickslip_ros.plots.run_history import RunHistory

_MOST_DRAWN = 6
"""Bags that a figure can show, each in its own colour."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "bags",
        metavar="BAG",
        nargs="+",
        type=Path,
        help="bag directory, or one .mcap file; also one that is being recorded, cut off or "
        "damaged: the readable part is measured, and a sentence names what is missing. Or a table, "
        ".csv or .mat: one of `stickslip simulate --out`, or any other with --columns",
    )
    add_columns(parser)
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
        help="also find slips: drops of the position by more than this, m, one by one",
    )
    parser.add_argument(
        "--slip-time",
        type=seconds,
        default=0.1,
        metavar="S",
        help="longest time in which a slip drops by as much, s (default: 0.1)",
    )
    add_part(parser)
    add_plot(
        parser,
        "motion, force, cycles and friction law of a bag; of several bags motion and force side by "
        "side, their cycles and phase portraits in the same panels",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.recordings import recorded_drive
    from stickslip_ros.bags.report import report_of_recording
    from stickslip_ros.bags.table_file import is_table
    from stickslip_ros.physics.measures.slips import SlipThreshold
    from stickslip_ros.plots.measure_table import report_tables
    from stickslip_ros.plots.run_history import RunHistory

    plot: Path | None = arguments.plot
    bags: list[Path] = arguments.bags
    check_figure(arguments)
    if plot is not None and len({*bags}) > _MOST_DRAWN:
        raise InvalidInputError(
            f"--plot {plot}: draws at most {_MOST_DRAWN} bags, and {len({*bags})} were given"
        )
    histories = {} if plot is None else {str(bag): RunHistory() for bag in bags}
    columns = columns_of(arguments.columns)
    if columns is not None and not any(map(is_table, bags)):
        raise InvalidInputError(f"--columns {arguments.columns}: a bag has no columns")
    slips = None if arguments.slips is None else SlipThreshold(arguments.slips, arguments.slip_time)
    reports: dict[str, dict[str, Any]] = {}
    for bag in dict.fromkeys(bags):
        reports[str(bag)] = report_of_recording(
            bag,
            columns,
            start=arguments.start,
            end=arguments.end,
            namespace=arguments.namespace,
            stick_speed=arguments.stick_speed,
            belt_speed=arguments.belt_speed,
            slips=slips,
            observer=histories.get(str(bag)),
        )
    if plot is not None:
        _draw(arguments, histories, reports)
    if arguments.json:
        results = [{**report, "bag": bag} for bag, report in reports.items()]
        result = results[0] if len(results) == 1 else {"reports": results}
        print_json(result)
        return
    drives = {str(bag): recorded_drive(bag, arguments.namespace) for bag in bags}
    print_parts(report_tables(reports, drives))


def _draw(
    arguments: argparse.Namespace,
    histories: Mapping[str, "RunHistory"],
    reports: Mapping[str, Mapping[str, Any]],
) -> None:
    from stickslip_ros.api.recordings import recorded_drive
    from stickslip_ros.plots.run_figure import DrawnRun, run_figure

    runs = [
        DrawnRun.recorded(
            Path(bag), histories[bag], report, recorded_drive(Path(bag), arguments.namespace)
        )
        for bag, report in reports.items()
    ]
    write_figure(arguments, lambda style: run_figure(*runs, style=style))
