"""`stickslip list`: the scenarios, friction laws and control laws that can be named."""

import argparse
import sys
from collections.abc import Iterable
from inspect import getdoc
from itertools import chain, repeat
from shutil import get_terminal_size
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import add_json
from stickslip_ros.app.output import print_json, tell
from stickslip_ros.text import printable

if TYPE_CHECKING:
    from stickslip_ros.model.control import ControlLaw
    from stickslip_ros.model.friction import FrictionLaw


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "List the shipped scenarios, which commands take by name, the friction laws "
        "(plant.friction.law) and the control laws (--controller), with the parameters that each "
        "law uses."
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.model.control import CONTROL_LAWS
    from stickslip_ros.model.friction import LAWS
    from stickslip_ros.scenarios.files import shipped_scenarios
    from stickslip_ros.scenarios.foreign_laws import CONTROLLERS, FRICTION_LAWS
    from stickslip_ros.scenarios.friction_parameters import law_parameters
    from stickslip_ros.scenarios.parameters import controller_node
    from stickslip_ros.scenarios.sections import leading_comment

    for kind, family in (("friction law", FRICTION_LAWS), ("control law", CONTROLLERS)):
        for name, reason in family.refused.items():
            tell(f"{kind} {name} is refused: {reason}")
    scenarios = [
        {"name": name, "description": leading_comment(path), "path": str(path)}
        for name, path in shipped_scenarios().items()
    ]
    friction_laws = [_law(law, "plant.friction", law_parameters(law)) for law in LAWS.values()]
    control_laws = [
        _law(law, controller_node(name), law.constants()) for name, law in CONTROL_LAWS.items()
    ]
    if arguments.json:
        print_json(
            {"scenarios": scenarios, "friction_laws": friction_laws, "control_laws": control_laws}
        )
        return
    _print("scenarios", {scenario["name"]: [scenario["description"]] for scenario in scenarios})
    for heading, laws in (
        ("friction laws, plant.friction.law", friction_laws),
        ("control laws, --controller", control_laws),
    ):
        print()
        texts: dict[str, list[str]] = {}
        for law in laws:
            names = ", ".join(name.rpartition(".")[2] for name in law["parameters"])
            texts[law["name"]] = [law["description"], f"parameters: {names}"]
        _print(heading, texts)


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


def _law(
    law: "type[FrictionLaw | ControlLaw]", group: str, parameters: Iterable[str]
) -> dict[str, Any]:
    return {
        "name": law.name,
        "description": (getdoc(law) or "").partition("\n")[0],
        "parameters": [f"{group}.{name}" for name in parameters],
    }
