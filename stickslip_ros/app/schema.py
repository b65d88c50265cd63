"""`stickslip schema`: the JSON schema of scenario files."""

import argparse

from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.app.output import print_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command, which has none."""
    parser.description = (
        "Print the JSON schema of scenario files. With it an editor completes the names of "
        "parameters, shows meaning, unit and default, and marks refused values."
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with interrupts_kept():
        from stickslip_ros.scenarios.schema import scenario_schema
    print_json(scenario_schema())
    return 0
