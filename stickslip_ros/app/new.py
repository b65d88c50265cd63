"""`stickslip new`: a scenario file to edit."""

import argparse
import os
import shlex
from functools import partial
from pathlib import Path

from stickslip_ros.app.arguments import add_law, check_new, with_law, write_new
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.text import printable

_ENDINGS = (".yaml", ".yml")
_SOURCE = "feed_drive"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Write a scenario file with the parameters of a drive and its controller. Comments give "
        "meaning, unit and bounds of each. Edit the file, then give it to any command in place of "
        "a scenario's name. It is a ROS parameter file: a complete one is read by nodes with "
        "--params-file, too."
    )
    parser.add_argument(
        "file", metavar="FILE", type=Path, help="file to write, .yaml; must not exist"
    )
    parser.add_argument(
        "--from",
        dest="source",
        default=_SOURCE,
        metavar="SCENARIO",
        help="scenario whose values the file starts with, by name or path (default: %(default)s)",
    )
    parser.add_argument(
        "--complete", action="store_true", help="write every parameter of every node"
    )
    add_law(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.scenarios.files import load_scenario
    from stickslip_ros.scenarios.template import commented_file, short_file

    path: Path = arguments.file
    if path.suffix not in _ENDINGS:
        raise InvalidInputError(f"{path}: must end in {' or '.join(_ENDINGS)}")
    check_new("FILE", path)
    scenario = with_law(partial(load_scenario, arguments.source), arguments.controller)
    command = printable(shlex.join(["stickslip", "simulate", str(path)]))
    title = f"{path.stem}: a drive with the values of {scenario.name}, to be edited."
    heading = f"{printable(title)}\n{command}"
    text = commented_file(scenario, heading)
    if not arguments.complete:
        named = arguments.source == scenario.name
        base = scenario.name if named else os.path.relpath(scenario.path, path.parent)
        text = short_file(scenario, heading, base)
    write_new("FILE", path, text)
    design = printable(shlex.join(["stickslip", "design", str(path)]))
    tuned = scenario.plant.expects_control and scenario.controller.control_law.tuned
    said = f", `{design}` finds gains for it" if tuned else ""
    print(f"{printable(str(path))} is written: `{command}` simulates it{said}")
