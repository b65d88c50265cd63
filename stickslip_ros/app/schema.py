"""`stickslip schema`: the JSON schema of scenario files."""

import argparse
import json

from stickslip_ros.text import finite


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command, which has none."""
    parser.description = (
        "Print the JSON schema of scenario files. With it an editor completes the names of "
        "parameters, shows meaning, unit and default, and marks refused values."
    )


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.scenarios.template import scenario_schema

    print(json.dumps(finite(scenario_schema()), indent=2))
