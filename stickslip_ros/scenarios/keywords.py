"""Parameters by keyword, `friction_static`, and by text, plant.friction.static=0.4."""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from sys import float_info
from typing import Any

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Parameter
from stickslip_ros.quantities import QUANTITY, number_of
from stickslip_ros.scenarios import ros_yaml
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.text import did_you_mean

_NAMED_WITH_NODE = "analyzer.belt_speed", "plant.force_type", "plant.force_number"
"""Parameters whose keywords have their node: `belt_speed` is that of the plant."""


def keyword_of(parameter: str) -> str:
    """Return the keyword for NODE.PARAMETER: its flat name with underscores for dots."""
    if parameter in _NAMED_WITH_NODE:
        return parameter.replace(".", "_")
    return parameter.partition(".")[2].replace(".", "_")


def described(parameter: str) -> Parameter:
    """Return the description of NODE.PARAMETER."""
    node, _, name = parameter.partition(".")
    return NODE_PARAMETERS[node].known[name]


def parameter_of(keyword: str, nodes: Sequence[str]) -> str:
    """Return NODE.PARAMETER for a keyword, of one of the `nodes`.

    Raises InvalidInputError for one that no node has, or that several nodes have.
    """
    known = _parameters(tuple(nodes))
    names: list[str] = [*known.get(keyword, ())]
    if not names:
        unused = [node for node in NODE_PARAMETERS if node not in nodes]
        owners = [node for node in unused if keyword in _parameters((node,))]
        if owners:
            in_use = next(node for node in nodes if node not in ("plant", "analyzer"))
            raise InvalidInputError(
                f"{keyword}: is a parameter of {', '.join(owners)}; the controller in use is "
                f"{in_use}"
            )
        raise InvalidInputError(
            f"{keyword:.80}: no node has such a parameter; "
            + did_you_mean(keyword, known, "docs/parameters.md has them all")
        )
    if len(names) > 1:
        raise InvalidInputError(
            f"{keyword}: several nodes have this parameter; write {' or '.join(names)} in a text "
            "NODE.PARAMETER=VALUE"
        )
    return names[0]


def plain(value: Any) -> Any:
    """Return a value as a scenario file has it: a number, a list, or else a text."""
    value = value.item() if hasattr(value, "item") else value  # a number of numpy's
    tiny = isinstance(value, float) and 0.0 < abs(value) < float_info.min  # a text to ROS
    return value if isinstance(value, int | float | list) and not tiny else str(value)


def override(parameter: str, value: Any) -> str:
    """Return the text NODE.PARAMETER=VALUE, the plain value written as in a scenario file."""
    if isinstance(value, float):
        return f"{parameter}={value!r}"
    text = value if isinstance(value, str) else json.dumps(value)
    try:
        quoted = isinstance(value, str) and not (
            text.isprintable() and ros_yaml.parse(text, "") == text
        )
    except InvalidInputError:
        quoted = True
    return f"{parameter}={json.dumps(text) if quoted else text}"


def parse_override(text: str) -> tuple[str, str, Any]:
    """Return node, parameter and value of a text NODE.PARAMETER=VALUE.

    The value is not checked. Raises InvalidInputError for an unknown node or parameter.
    """
    target, equals, written = text.partition("=")
    node, _, parameter = target.partition(".")
    known = [f"{node}.{name}" for node, model in NODE_PARAMETERS.items() for name in model.known]
    given = f"{text:.80}"
    if equals and target in known:
        value = ros_yaml.parse(written, f"{given}: the value")
        return node, parameter, in_own_unit(target, value)
    if not equals or not parameter:
        usual = [keyword for keyword in known if keyword not in _NAMED_WITH_NODE]
        meant = did_you_mean(target, usual, "as in plant.belt_speed=0.2")
        raise InvalidInputError(f"{given}: must be NODE.PARAMETER=VALUE; {meant}")
    if node not in NODE_PARAMETERS:
        meant = did_you_mean(node, NODE_PARAMETERS)
        raise InvalidInputError(f"{given}: unknown node {node:.80}; {meant}")
    every = f"{node} has {', '.join(sorted(NODE_PARAMETERS[node].known))}"
    meant = did_you_mean(target, known, every)
    raise InvalidInputError(f"{given}: unknown parameter {parameter:.80}; {meant}")


def in_own_unit(parameter: str, value: Any) -> Any:
    """Return a value for NODE.PARAMETER; of a text with a unit the number in the parameter's."""
    its = described(parameter)
    if its.kind is float and isinstance(value, str) and QUANTITY.fullmatch(value):
        return number_of(parameter, value, its.unit)
    return value


@cache
def _parameters(nodes: tuple[str, ...]) -> Mapping[str, tuple[str, ...]]:
    """Return NODE.PARAMETER of each keyword."""
    parameters: dict[str, tuple[str, ...]] = {}
    for node in nodes:
        for name in NODE_PARAMETERS[node].known:
            parameter = f"{node}.{name}"
            keyword = keyword_of(parameter)
            parameters[keyword] = (*parameters.get(keyword, ()), parameter)
    return parameters
