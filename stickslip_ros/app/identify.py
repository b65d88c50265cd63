"""`stickslip identify`: a model of a drive from recordings."""

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import add_out, check_new, writing
from stickslip_ros.app.output import progress_bar, tell
from stickslip_ros.app.recordings import add_reading, add_recordings, reading_of
from stickslip_ros.app.result import add_results, check_results, give_result
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
    add_recordings(
        parser,
        "bag, or table (text, .mat) with --columns; several of one machine are fitted together",
    )
    parser.add_argument(
        "--map",
        action="store_true",
        help="the tables have pairs of velocity and force, of tests at constant speeds: fit "
        "friction alone, by the law coulomb or exponential",
    )
    parser.add_argument(
        "--law",
        default="auto",
        metavar="NAME",
        help="friction law, or auto: the one that predicts best (default: %(default)s)",
    )
    parser.add_argument(
        "--time-limit",
        type=float,
        default=60.0,
        metavar="S",
        help="work for auto, in s of a usual processor on any machine; then the best law so far is "
        "taken (default: %(default)g)",
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
    add_reading(parser)
    add_out(parser, "a complete scenario of the drive")
    add_results(parser, "the friction curve with its band, residuals, and the run without feedback")


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.identification import identify
    from stickslip_ros.identification.identify import fixed_of
    from stickslip_ros.identification.scenario import curve_files

    reading = reading_of(arguments)
    if arguments.out is not None:
        if arguments.out.suffix not in (".yaml", ".yml"):
            raise InvalidInputError(f"--out {arguments.out}: must end in .yaml or .yml")
        for path in (arguments.out, *curve_files(arguments.out)):
            check_new("--out", path)
    check_results(arguments)
    if arguments.map:
        _fit_map(arguments, reading)
        return
    fixed = fixed_of(arguments.fix)
    with progress_bar("identifying", None, lines=True) as progress:
        model = identify(
            *arguments.recordings,
            law=arguments.law,
            fixed=fixed,
            time_limit=arguments.time_limit,
            check=arguments.check,
            progress=lambda law: progress(0.0, f"identifying: {law}"),
            **reading,
        )
        progress(0.0, "predicting")
        _ = model.predictions  # they take a while, and are kept
    give_result(arguments, model)
    if arguments.out is not None:
        _write(arguments.out, model.findings)


_FORM_OF_MAP = ("rotary", "decimal", "skip", "encoding", "force_constant", "pitch")
"""Options of tables that a map has."""


def _fit_map(arguments: argparse.Namespace, reading: dict[str, Any]) -> None:
    """Fit friction to pairs of velocity and force; refuse what a map has not."""
    from stickslip_ros.api.friction_map import friction_map

    for option in ("out", "fix", "check"):
        if getattr(arguments, option):
            raise InvalidInputError(f"--{option}: a map has friction only, and no drive")
    options = {name: reading[name] for name in _FORM_OF_MAP}
    columns = reading["columns"] or {}
    fitted = friction_map(*arguments.recordings, columns=columns, law=arguments.law, **options)
    give_result(arguments, fitted)


def _write(path: Path, findings: "Findings") -> None:
    from stickslip_ros.identification.scenario import written_scenario

    with writing("--out", path):
        files = written_scenario(findings, path)
    names = ", ".join(map(str, files))
    command = shlex.join(["stickslip", "simulate", str(path)])
    still = ", which stays at rest until a force or a reference moves it"
    moves = "" if findings.chosen.has_spring else still
    tell(f"{names}: written; `{command}` simulates the drive{moves}")
