"""`stickslip report`: the measures of recorded runs."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import add_json, add_plot, check_picture, seconds, write_picture
from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.app.output import print_figures, print_json
from stickslip_ros.app.why_no_cycle import why_no_cycle
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.text import printable
from stickslip_ros.versions import versions

if TYPE_CHECKING:
    from stickslip_ros.physics.model.drive import Drive
    from stickslip_ros.plots.run_history import RunHistory

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
        "--namespace", metavar="NS", help="ROS namespace of the drive, where a bag holds several"
    )
    add_plot(parser, "motion, force, cycles and friction law of the one bag")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with interrupts_kept():
        from stickslip_ros.bags.report import report_of_bag
        from stickslip_ros.plots.run_history import RunHistory
        from stickslip_ros.plots.units import Units
    plot: Path | None = arguments.plot
    bags: list[Path] = arguments.bags
    check_picture(plot)
    if plot is not None and len(bags) > 1:
        raise InvalidInputError(f"--plot {plot}: draws one bag, and {len(bags)} were given")
    history = None if plot is None else RunHistory()
    reports = {
        str(bag): report_of_bag(
            bag,
            start=arguments.start,
            end=arguments.end,
            namespace=arguments.namespace,
            observer=history,
        )
        for bag in bags
    }
    if plot is not None and history is not None:
        drive = _drive_of(bags[0], arguments.namespace)
        _draw(plot, bags[0], drive, history, reports[str(bags[0])])
    if arguments.json:
        results = [{**report, "bag": bag} for bag, report in reports.items()]
        result = results[0] if len(results) == 1 else {"reports": results}
        print_json({**result, "versions": versions()})
        return 0
    several = len(reports) > 1
    drives = {str(bag): _drive_of(bag, arguments.namespace) for bag in bags}
    print_figures(
        "" if several else str(bags[0]),
        {bag if several else "": report for bag, report in reports.items()},
        {bag if several else "": Units.for_drive(drive) for bag, drive in drives.items()},
    )
    for bag, report in reports.items():
        sentences = [*report["missing"], *report["notes"]]
        if report["samples"] > 0:
            reason = why_no_cycle(report["regime"], report["duration"], drives[bag])
            sentences += [] if reason is None else [reason]
        for sentence in sentences:
            print(printable(f"{bag}: {sentence}") if several else sentence)
    return 0


def _draw(
    path: Path, bag: Path, drive: "Drive | None", history: "RunHistory", report: dict[str, Any]
) -> None:
    from dataclasses import fields

    from stickslip_ros.physics.measures.cycle_measures import Measures
    from stickslip_ros.plots.run_figure import run_figure

    notes = [*report["missing"], *report["notes"]]
    if drive is None:
        notes.append("the bag does not say what drive it was: no equilibrium, no friction law")
    measures = Measures(**{field.name: report[field.name] for field in fields(Measures)})
    write_picture(path, run_figure(history, measures, drive, title=str(bag), notes=notes))


def _drive_of(bag: Path, namespace: str | None) -> "Drive | None":
    """Return the drive whose parameters were recorded, None where they are not or not all."""
    from stickslip_ros.bags.reader import Recording
    from stickslip_ros.scenarios.parameter_field import known_parameters
    from stickslip_ros.scenarios.parameters import PlantParameters

    with Recording(bag, namespace) as recording:
        texts = recording.metadata("stickslip_ros/plant") or {}
    try:
        values = {
            name: json.loads(text)
            for name, text in texts.items()
            if name in known_parameters(PlantParameters)
        }
        plant = PlantParameters.validated(values, str(bag))
    except (ValueError, RecursionError, InvalidInputError):
        return None
    return plant.as_drive() if values.keys() >= set(plant.drive_names()) else None
