"""A complete scenario file with comments, to be edited by a user."""

from collections.abc import Iterator
from textwrap import wrap

from stickslip_ros.physics.model.constants import Parameter
from stickslip_ros.scenarios import ros_yaml
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, NodeParameters
from stickslip_ros.scenarios.ros_yaml import PARAMETERS_KEY

_WIDTH = 100


def commented_file(scenario: Scenario, heading: str) -> str:
    """Return the text of a scenario file with every parameter of every node of the scenario.

    A comment above each parameter gives its meaning, its unit and what is allowed. What the
    scenario's laws and settings do not use has its default. `heading` is the comment at the top,
    line by line.
    """
    lines = [part for line in heading.splitlines() for part in _comment(line, "")]
    unused = scenario.unused()
    for node, own in scenario.as_dict().items():
        parameters = own_first(NODE_PARAMETERS[node])
        if node == "plant":  # whose values would be refused
            own |= {p.name: p.default for p in parameters if f"plant.{p.name}" in unused}
        lines += ["", f"/**/{node}:", f"  {PARAMETERS_KEY}:"]
        lines += _section(parameters, own)
    return "\n".join(lines) + "\n"


def own_first(node: NodeParameters) -> list[Parameter]:
    """Return the parameters of a node, those that every node has at the end."""
    common = NodeParameters().known
    return sorted(node.known.values(), key=lambda parameter: parameter.name in common)


def _section(parameters: list[Parameter], values: dict[str, object]) -> Iterator[str]:
    group = ""
    for parameter in parameters:
        own_group, _, name = parameter.name.rpartition(".")
        if own_group != group and own_group:
            yield f"    {own_group}:"
        group = own_group
        indent = "      " if group else "    "
        yield from _comment(_explained(parameter), indent)
        # ROS cannot read an empty list: it does not say of what type the items are.
        lead = f"{indent}# " if values[parameter.name] == [] else indent
        text = ros_yaml.dump({name: values[parameter.name]}).replace('"', "", 2)
        yield from (lead + line for line in text.splitlines())


def _explained(parameter: Parameter) -> str:
    allowed = parameter.bounds
    if not parameter.finite:
        allowed = f"{allowed}, or .inf" if allowed else "or .inf"
    if parameter.unset:
        allowed = (
            f"{allowed}, or .nan: {parameter.unset}" if allowed else f".nan: {parameter.unset}"
        )
    notes = ", ".join(filter(None, [parameter.unit, allowed]))
    return f"{parameter.meaning} [{notes}]" if notes else parameter.meaning


def _comment(text: str, indent: str) -> list[str]:
    return [f"{indent}# {line}" for line in wrap(text, _WIDTH - len(indent) - 2)]
