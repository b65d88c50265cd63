"""`stickslip list`: the scenarios, friction laws and control laws that can be named."""

import argparse
from inspect import getdoc
from pathlib import Path
from typing import Any

from stickslip_ros.app.arguments import add_json
from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.app.output import print_json, print_table
from stickslip_ros.versions import versions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "List the shipped scenarios, which commands take by name, the friction laws "
        "(plant.friction.law) and the control laws, with the parameters that each law uses."
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with interrupts_kept():
        from stickslip_ros.physics.model.friction import LAWS
        from stickslip_ros.scenarios.files import shipped_scenarios
        from stickslip_ros.scenarios.parameters import WashoutControllerParameters
    scenarios = [_scenario(name, path) for name, path in shipped_scenarios().items()]
    friction_laws: list[dict[str, Any]] = [
        {
            "name": name,
            "description": (getdoc(law) or "").partition("\n")[0],
            "parameters": [f"plant.friction.{constant}" for constant in law.constants()],
        }
        for name, law in LAWS.items()
    ]
    washout: dict[str, Any] = {
        "name": "washout",
        "description": "Washout filter with linear and cubic velocity feedback.",
        "parameters": [
            f"washout_controller.{name}" for name in WashoutControllerParameters.law_names()
        ],
    }
    if arguments.json:
        print_json(
            {
                "scenarios": scenarios,
                "friction_laws": friction_laws,
                "control_laws": [washout],
                "versions": versions(),
            }
        )
        return 0
    rows = [[scenario["name"], scenario["description"]] for scenario in scenarios]
    print_table("", ["scenario", "description"], rows)
    for heading, laws in (("friction law", friction_laws), ("control law", [washout])):
        rows = [[law["name"], _short(law["parameters"]), law["description"]] for law in laws]
        print()
        print_table("", [heading, "parameters", "description"], rows)
    return 0


def _scenario(name: str, path: Path) -> dict[str, str]:
    from stickslip_ros.scenarios.sections import leading_comment

    return {"name": name, "description": leading_comment(path), "path": str(path)}


def _short(parameters: list[str]) -> str:
    return ", ".join(parameter.rpartition(".")[2] for parameter in parameters)
