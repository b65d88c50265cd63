"""The JSON schema of scenario files, with which an editor completes and checks them."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from stickslip_ros.physics.model.constants import Parameter
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.scenarios.ros_yaml import PARAMETERS_KEY
from stickslip_ros.scenarios.sections import BASE_SECTION

_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


def scenario_schema() -> dict[str, Any]:
    """Return the schema (draft 7, which every editor reads) of a scenario file.

    Sections of other nodes may have any content. A group of parameters may be nested
    (`friction: {law: ...}`) or flat (`friction.law: ...`), as in ROS.
    """
    sections: dict[str, Any] = {
        node: _section(_parameters(list(model.known.values())))
        for node, model in NODE_PARAMETERS.items()
    }
    base = {
        "type": "string",
        "minLength": 1,
        "description": "Name or path of the scenario that gives what this file omits.",
    }
    sections[BASE_SECTION] = _section({"base": base}, required=["base"])
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


def _section(properties: Mapping[str, Any], required: list[str] | None = None) -> dict[str, Any]:
    parameters: dict[str, Any] = {
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
    }
    if required:
        parameters["required"] = required
    return {
        "type": "object",
        "properties": {PARAMETERS_KEY: parameters},
        "required": [PARAMETERS_KEY],
        "additionalProperties": False,
    }


def _parameters(parameters: list[Parameter]) -> dict[str, Any]:
    """Return the schemas of parameters by name, those of a group also nested."""
    schemas: dict[str, Any] = {}
    for parameter in parameters:
        _add(schemas, parameter.name, _value(parameter))
    return schemas


def _add(schemas: dict[str, Any], name: str, schema: Mapping[str, Any]) -> None:
    """Add the schema of a parameter by its name, and nested in each of its groups."""
    schemas[name] = schema
    for dot in (place for place, letter in enumerate(name) if letter == "."):
        group = schemas.setdefault(
            name[:dot], {"type": "object", "properties": {}, "additionalProperties": False}
        )
        _add(group["properties"], name[dot + 1 :], schema)


def _value(parameter: Parameter) -> dict[str, Any]:
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
