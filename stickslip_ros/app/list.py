"""`stickslip list`: the scenarios, friction laws and control laws that can be named."""

import argparse
import sys
from inspect import getdoc
from itertools import chain, repeat
from pathlib import Path
from shutil import get_terminal_size
from textwrap import wrap
from typing import Any

from stickslip_ros.app.arguments import add_json
from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.app.output import print_json
from stickslip_ros.text import printable
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
        from stickslip_ros.scenarios.friction_laws import REFUSED_LAWS
        from stickslip_ros.scenarios.parameters import WashoutControllerParameters
    for name, reason in REFUSED_LAWS.items():
        print(printable(f"friction law {name} is refused: {reason}"), file=sys.stderr)
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
    _print("scenarios", {each["name"]: [each["description"]] for each in scenarios})
    for heading, laws in (
        ("friction laws, plant.friction.law", friction_laws),
        ("control laws", [washout]),
    ):
        print()
        _print(
            heading, {law["name"]: [law["description"], _short(law["parameters"])] for law in laws}
        )
    return 0


def _print(heading: str, items: dict[str, list[str]]) -> None:
    """Print names with lines of text beside them, wrapped on a terminal."""
    print(f"{heading}:")
    width = max(map(len, items)) + 4
    columns = get_terminal_size().columns if sys.stdout.isatty() else 0
    for name, texts in items.items():
        lines = [
            line
            for text in texts
            for line in (wrap(text, max(columns - width, 20)) if columns else [text])
        ]
        for lead, line in zip(chain([f"  {name}"], repeat("")), lines, strict=False):
            print(printable(f"{lead:{width}}{line}"))


def _scenario(name: str, path: Path) -> dict[str, str]:
    from stickslip_ros.scenarios.sections import leading_comment

    return {"name": name, "description": leading_comment(path), "path": str(path)}


def _short(parameters: list[str]) -> str:
    return "parameters: " + ", ".join(parameter.rpartition(".")[2] for parameter in parameters)
