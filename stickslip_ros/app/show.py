"""`stickslip show`: every parameter of a scenario, and where its value comes from."""

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import add_json, add_law, add_scenario_file, with_law
from stickslip_ros.app.output import print_json, print_table
from stickslip_ros.text import printable

if TYPE_CHECKING:
    from stickslip_ros.physics.model.constants import Parameter
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
    from stickslip_ros.plots.units import Units
    from stickslip_ros.scenarios.files import load_scenario
    from stickslip_ros.scenarios.parameters import NODE_PARAMETERS

    load = partial(
        load_scenario,
        arguments.scenario,
        arguments.overrides,
        base=arguments.base,
        other_nodes=True,
    )
    scenario = with_law(load, arguments.controller)
    found = {node: _parameters(scenario, node) for node in scenario.nodes}
    bases = [str(path) for path in scenario.bases]
    if arguments.json:
        print_json(
            {
                "name": scenario.name,
                "path": str(scenario.path),
                "bases": bases,
                "overrides": list(scenario.overrides),
                "parameters": found,
                "other_sections": list(scenario.other_sections),
            }
        )
        return
    print(printable(f"{scenario.name}: {', completed by '.join([str(scenario.path), *bases])}"))
    units = Units.for_drive(scenario.plant.as_drive())
    for node, parameters in found.items():
        # Where the drive is dimensionless, so are the parameters of the loop.
        unit = str if node == "analyzer" else units.of_unit
        known = NODE_PARAMETERS[node].known
        rows = [
            [name, _text(known[name], row["value"]), unit(row["unit"] or ""), row["source"]]
            for name, row in parameters.items()
        ]
        print()
        print_table("", [node, "value", "unit", "from"], rows)
    for section in scenario.other_sections:
        print(printable(f"\nsection {section} is for another node"))


def _parameters(scenario: "Scenario", node: str) -> dict[str, dict[str, Any]]:
    from stickslip_ros.scenarios.files import DEFAULT
    from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
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


def _text(parameter: "Parameter", value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else parameter.text(value)
