"""`stickslip export`: the control law as source code for a drive without ROS."""

import argparse
from pathlib import Path

from stickslip_ros.app.arguments import add_scenario, check_writable, scenario_of, write_new
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.text import printable


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Write the control law of a scenario, with its gains, at the rate of the plant, as a "
        "function in C99 or a function block in IEC 61131-3 Structured Text. Its inputs are what "
        "the encoders measure, and the reference; it gives the forces that the law gives here."
    )
    add_scenario(parser)
    parser.add_argument(
        "--out", required=True, type=Path, metavar="FILE", help="file to write, .c or .st"
    )


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.show.law_code import LANGUAGES, law_code

    path: Path = arguments.out
    if path.suffix not in LANGUAGES:
        raise InvalidInputError(f"--out {path}: must end in {' or '.join(LANGUAGES)}")
    check_writable("--out", path)
    scenario = scenario_of(arguments)
    if not scenario.plant.expects_control:
        raise InvalidInputError("without control there is no law to export")
    text = law_code(scenario, LANGUAGES[path.suffix])
    write_new("--out", path, text)
    law, rate = scenario.controller.law, scenario.plant.control_rate
    print(f"{printable(str(path))} is written: {law} at {rate:g} Hz")
