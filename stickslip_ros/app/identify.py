"""`stickslip identify`: a model of a drive from recordings."""

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import (
    add_columns,
    add_json,
    add_part,
    add_plot,
    check_figure,
    check_new,
    columns_of,
    write_figure,
    writing,
)
from stickslip_ros.app.output import print_json, print_parts, progress_bar, tell
from stickslip_ros.errors import InvalidInputError

if TYPE_CHECKING:
    from stickslip_ros.identification.findings import Findings

_DESCRIPTION = """Fit a model to recordings of a drive: mass, stiffness, damping, and friction by a
law or as a curve, with 95 % intervals. A belt that is at rest in all recordings means an axis
without a spring, unless a stiffness is given. The law is chosen by what it predicts of parts that
were held out; a simpler one is preferred where the difference is noise."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    parser.add_argument(
        "recordings",
        metavar="RECORDING",
        nargs="+",
        type=Path,
        help="bag, or table (.csv, .mat) with --columns; several of the same machine are fitted "
        "together",
    )
    add_columns(parser)
    parser.add_argument(
        "--law",
        default="auto",
        metavar="NAME",
        help="friction law, or auto: the one that predicts best (default: %(default)s)",
    )
    parser.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="PARAMETER=VALUE",
        help="a constant that is known, as in --fix plant.mass=95: mass, damping, stiffness, "
        "bias_force, normal_force, force_delay or, with --law, a constant of its friction; can be "
        "repeated",
    )
    parser.add_argument(
        "--check",
        action="append",
        default=[],
        type=Path,
        metavar="RECORDING",
        help="predict a recording that is not fitted; can be repeated",
    )
    add_part(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="write a complete scenario of the drive; an existing file is refused",
    )
    add_plot(parser, "the friction curve with its band, residuals, and the run without feedback")
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.identification.findings import notes_on
    from stickslip_ros.identification.identify import fixed_of, identify_recordings
    from stickslip_ros.identification.record import read_all
    from stickslip_ros.identification.scenario import curve_files
    from stickslip_ros.plots.identification_table import identification_tables

    columns = columns_of(arguments.columns)
    if arguments.out is not None:
        if arguments.out.suffix not in (".yaml", ".yml"):
            raise InvalidInputError(f"--out {arguments.out}: must end in .yaml or .yml")
        for path in (arguments.out, *curve_files(arguments.out)):
            check_new("--out", path)
    check_figure(arguments)
    fixed = fixed_of(arguments.fix)
    options: dict[str, Any] = {
        "start": arguments.start,
        "end": arguments.end,
        "namespace": arguments.namespace,
        "belt_speed": arguments.belt_speed,
    }
    read = read_all([*arguments.recordings, *arguments.check], columns, **options)
    with progress_bar("identifying", None) as progress:
        found = identify_recordings(
            [read[path] for path in dict.fromkeys(arguments.recordings)],
            arguments.law,
            fixed,
            lambda law: progress(0.0, f"identifying: {law}"),
        )
        progress(0.0, "predicting")
        own = found.check(found.records[0])
        checks: list[dict[str, Any]] = []
        notes = [*found.notes]
        for path in dict.fromkeys(arguments.check):
            records = read[path].records
            for number, record in enumerate(records, start=1):
                name = str(path) if len(records) == 1 else f"{path}, part {number}"
                checks.append({"recording": name, **found.check(record)})
                notes += notes_on(found, record)
    if arguments.json:
        print_json(as_dict(found, own, checks, notes))
    else:
        print_parts(identification_tables(found, own, checks, notes))
    if arguments.plot is not None:
        from stickslip_ros.plots.identification_figure import identification_figure

        write_figure(arguments, lambda style: identification_figure(found, style=style))
    if arguments.out is not None:
        _write(arguments.out, found)


def _write(path: Path, found: "Findings") -> None:
    from stickslip_ros.identification.scenario import written_scenario

    with writing("--out", path):
        files = written_scenario(found, path)
    names = ", ".join(map(str, files))
    command = shlex.join(["stickslip", "simulate", str(path)])
    moves = (
        "" if found.has_spring else ", which stays at rest until a force or a reference moves it"
    )
    tell(f"{names}: written; `{command}` simulates the drive{moves}")


def as_dict(
    found: "Findings",
    own: dict[str, float | None],
    checks: Sequence[dict[str, Any]],
    notes: Sequence[str],
) -> dict[str, Any]:
    """Return the findings for JSON."""
    curves: list[dict[str, Any]] = []
    for number, direction in enumerate(found.directions):
        curve = found.friction(number)
        curves.append(
            {
                "direction": direction,
                "speed": curve.speed.tolist(),
                "force": curve.force.tolist(),
                "standard_error": curve.standard_error.tolist(),
            }
        )
    return {
        "law": found.law,
        "parameters": {
            f"plant.{name}": {
                "value": estimate.value,
                "standard_error": estimate.standard_error,
                "interval": list(estimate.interval),
            }
            for name, estimate in found.fitted.items()
        },
        "correlations": [
            {"parameters": [f"plant.{first}", f"plant.{second}"], "correlation": value}
            for first, second, value in found.correlations
        ],
        "unidentified": {f"plant.{name}": why for name, why in found.unidentified.items()},
        **own,
        "candidates": [
            {
                "law": each.law,
                "constants": each.size,
                "held_out_error": each.error,
                "by_direction": each.by_direction,
                "as_good": found.as_good.get(each.label, False),
                "remark": each.remark,
            }
            for each in found.candidates
        ],
        "curves": curves,
        "notes": list(notes),
        "servo": None if found.servo is None else vars(found.servo),
        "force_delay": found.delay,
        "checks": list(checks),
    }
