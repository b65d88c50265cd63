"""`stickslip show`: every parameter of a scenario, and where its value comes from."""

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import add_json, add_law, add_scenario_file, with_law
from stickslip_ros.app.output import print_json, print_parts
from stickslip_ros.text import printable

if TYPE_CHECKING:
    from stickslip_ros.scenarios.files import Scenario


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Show every parameter of a scenario with its value and unit. The last column says where "
        "the value comes from: the file, its base, an override (-p), or the default."
    )
    add_scenario_file(parser)
    add_law(parser)
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.scenarios.files import load_scenario
    from stickslip_ros.show.parameter_tables import scenario_tables

    load = partial(
        load_scenario,
        arguments.scenario,
        arguments.overrides,
        base=arguments.base,
        other_nodes=True,
    )
    scenario = with_law(load, arguments.controller)
    bases = [str(path) for path in scenario.bases]
    if arguments.json:
        print_json(
            {
                "name": scenario.name,
                "path": str(scenario.path),
                "bases": bases,
                "overrides": list(scenario.overrides),
                "parameters": {node: _parameters(scenario, node) for node in scenario.nodes},
                "other_sections": list(scenario.other_sections),
            }
        )
        return
    print(printable(f"{scenario.name}: {', completed by '.join([str(scenario.path), *bases])}"))
    for table in scenario_tables(scenario):
        print()
        print_parts(table)
    for section in scenario.other_sections:
        print(printable(f"\nsection {section} is for another node"))


def _parameters(scenario: "Scenario", node: str) -> dict[str, dict[str, Any]]:
    from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
    from stickslip_ros.scenarios.scenario import DEFAULT
    from stickslip_ros.scenarios.template import own_first

    values = scenario.as_dict()[node]
    return {
        parameter.name: {
            "value": values[parameter.name],
            "unit": parameter.unit,
            "source": scenario.sources.get(f"{node}.{parameter.name}", DEFAULT),
            "default": parameter.default,
            "allowed": parameter.bounds,
            "meaning": parameter.meaning,
        }
        for parameter in own_first(NODE_PARAMETERS[node])
    }
