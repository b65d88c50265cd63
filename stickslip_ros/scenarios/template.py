"""For users who write a scenario file: a complete one with comments, and a schema for editors."""

import json
from collections.abc import Iterator, Mapping
from math import isfinite
from textwrap import wrap
from typing import Any

from stickslip_ros.model.constants import Changes, Parameter
from stickslip_ros.scenarios import ros_yaml
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.parameter_group import NodeParameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.scenarios.ros_yaml import PARAMETERS_KEY
from stickslip_ros.scenarios.sections import BASE_SECTION, FIT_COLUMNS

_WIDTH = 100
_FIT = (
    "What the fit leaves open, for --spread fit: standard errors of constants of the plant, in SI "
    "units, and their correlations row by row."
)
_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


def short_file(scenario: Scenario, heading: str, base: str) -> str:
    """Return the text of a scenario file with the drive, its rate and its controller.

    The gains, and all else, are left to the `base`. A comment beside each parameter gives its
    meaning and what is allowed. `heading` is the comment at the top, line by line.
    """
    lines = [f"# {line}" for line in heading.splitlines()]
    lines += ["", f"/**/{BASE_SECTION}:", f"  {PARAMETERS_KEY}:"]
    lines += [f"    base: {json.dumps(base)}  # gives what this file omits"]
    shown = {*scenario.names_of_drive()}.difference(scenario.gains)
    for node, parameters in scenario.as_dict().items():
        names = [name for name in parameters if f"{node}.{name}" in shown]
        lines += ["", f"/**/{node}:", f"  {PARAMETERS_KEY}:"] if names else []
        for name in names:
            text = ros_yaml.dump({name: parameters[name]}).replace('"', "", 2).rstrip()
            lines.append(f"    {text}  # {_explained(NODE_PARAMETERS[node].known[name])}")
    return "\n".join(lines) + "\n"


def commented_file(scenario: Scenario, heading: str) -> str:
    """Return the text of a scenario file with every parameter of every node of the scenario.

    A comment above each parameter gives its meaning, its unit and what is allowed. What the
    scenario's laws and settings do not use has its default. `heading` is the comment at the top,
    line by line.
    """
    lines = [part for line in heading.splitlines() for part in _comment(line, "")]
    if scenario.fit:
        lines += ["", *_comment(_FIT, ""), f"/**/{BASE_SECTION}:", f"  {PARAMETERS_KEY}:"]
        block = ros_yaml.dump({"fit": scenario.fit}).splitlines()
        lines += [f"    {line.replace(chr(34), '') if ':' in line else line}" for line in block]
    unused = scenario.unused()
    for node, used in scenario.as_dict().items():
        parameters = own_first(NODE_PARAMETERS[node])
        if node == "plant":  # whose values would be refused
            used |= {p.name: p.default for p in parameters if f"plant.{p.name}" in unused}
        lines += ["", f"/**/{node}:", f"  {PARAMETERS_KEY}:"]
        lines += _section(parameters, used)
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
    changed = "" if parameter.changes is Changes.LIVE else f"changed {parameter.changes}"
    notes = ", ".join(filter(None, [parameter.unit, allowed, changed]))
    return f"{parameter.meaning} [{notes}]" if notes else parameter.meaning


def _comment(text: str, indent: str) -> list[str]:
    return [f"{indent}# {line}" for line in wrap(text, _WIDTH - len(indent) - 2)]


def scenario_schema() -> dict[str, Any]:
    """Return the schema (draft 7, which every editor reads) of a scenario file.

    Sections of other nodes may have any content. A group of parameters may be nested
    (`friction: {law: ...}`) or flat (`friction.law: ...`), as in ROS.
    """
    sections: dict[str, Any] = {}
    for node, model in NODE_PARAMETERS.items():
        schemas: dict[str, Any] = {}  # by name, those of a group also nested
        for parameter in model.known.values():
            _add(schemas, parameter.name, _schema(parameter))
        sections[node] = _schema_of_section(schemas)
    base = {
        "type": "string",
        "minLength": 1,
        "description": "Name or path of the scenario that gives what this file omits.",
    }
    lists = {column: {"type": "array"} for column in FIT_COLUMNS}
    fit = {"type": "object", "properties": lists, "required": [*FIT_COLUMNS]}
    sections[BASE_SECTION] = _schema_of_section({"base": base, "fit": fit})
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Scenario of stickslip_ros",
        "description": "ROS 2 parameter file with a section for each node.",
        "type": "object",
        "minProperties": 1,
        # What an editor proposes; the patterns hold for every other way to name a node.
        "properties": {f"/**/{name}": {"$ref": f"#/definitions/{name}"} for name in sections},
        "patternProperties": {
            f"^(.*/)?{name}/?$": {"$ref": f"#/definitions/{name}"} for name in sections
        },
        "additionalProperties": {"type": "object"},
        "definitions": sections,
    }


def _schema_of_section(properties: Mapping[str, Any]) -> dict[str, Any]:
    parameters: dict[str, Any] = {
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
    }
    return {
        "type": "object",
        "properties": {PARAMETERS_KEY: parameters},
        "required": [PARAMETERS_KEY],
        "additionalProperties": False,
    }


def _add(schemas: dict[str, Any], name: str, schema: Mapping[str, Any]) -> None:
    """Add the schema of a parameter by its name, and nested in each of its groups."""
    schemas[name] = schema
    for dot in (place for place, letter in enumerate(name) if letter == "."):
        group = schemas.setdefault(
            name[:dot], {"type": "object", "properties": {}, "additionalProperties": False}
        )
        _add(group["properties"], name[dot + 1 :], schema)


def _schema(parameter: Parameter) -> dict[str, Any]:
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    schema: dict[str, Any] = {"description": parameter.meaning + unit}
    if parameter.kind is list:
        schema |= {"type": "array", "items": {"type": "string"}}
    else:
        schema["type"] = _TYPES[parameter.kind]
    if parameter.choices:
        schema["enum"] = list(parameter.choices)
    if parameter.least is not None:
        schema["minimum"] = parameter.least
    if parameter.largest is not None:
        schema["maximum"] = parameter.largest
    if not isinstance(parameter.default, float) or isfinite(parameter.default):
        schema["default"] = parameter.default
    return schema
