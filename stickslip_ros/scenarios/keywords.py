"""Parameters by keyword: `friction_static` for plant.friction.static."""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios import ros_yaml
from stickslip_ros.scenarios.parameter_field import Parameter, known_parameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.text import did_you_mean


def keyword_of(parameter: str) -> str:
    """Return the keyword for NODE.PARAMETER: its flat name with underscores for dots."""
    return parameter.partition(".")[2].replace(".", "_")


def described(parameter: str) -> Parameter:
    """Return the description of NODE.PARAMETER."""
    node, _, name = parameter.partition(".")
    return known_parameters(NODE_PARAMETERS[node])[name]


def parameter_of(keyword: str, nodes: Sequence[str]) -> str:
    """Return NODE.PARAMETER for a keyword, of one of the `nodes`.

    Raises InvalidInputError for one that no node has, or that several nodes have.
    """
    known = _parameters(tuple(nodes))
    found: list[str] = [*known.get(keyword, ())]
    if not found:
        unused = [node for node in NODE_PARAMETERS if node not in nodes]
        owners = [node for node in unused if keyword in _parameters((node,))]
        if owners:
            in_use = next(node for node in nodes if node not in ("plant", "analyzer"))
            raise InvalidInputError(
                f"{keyword}: is a parameter of {' and '.join(owners)}, and the controller in use "
                f"is {in_use}"
            )
        raise InvalidInputError(
            f"{keyword:.80}: no node has such a parameter; "
            + did_you_mean(keyword, known, "docs/parameters.md has them all")
        )
    if len(found) > 1:
        raise InvalidInputError(
            f"{keyword}: several nodes have this parameter; write {' or '.join(found)} in a text "
            "NODE.PARAMETER=VALUE"
        )
    return found[0]


def override(parameter: str, value: Any) -> str:
    """Return the text NODE.PARAMETER=VALUE, the value written as in a scenario file."""
    return f"{parameter}={_written(value)}"


def overrides_of(values: Mapping[str, Any], nodes: Sequence[str]) -> list[str]:
    """Return the texts NODE.PARAMETER=VALUE for values by keyword."""
    return [override(parameter_of(keyword, nodes), value) for keyword, value in values.items()]


@cache
def _parameters(nodes: tuple[str, ...]) -> Mapping[str, tuple[str, ...]]:
    """Return NODE.PARAMETER of each keyword."""
    found: dict[str, tuple[str, ...]] = {}
    for node in nodes:
        for name in known_parameters(NODE_PARAMETERS[node]):
            parameter = f"{node}.{name}"
            keyword = keyword_of(parameter)
            found[keyword] = (*found.get(keyword, ()), parameter)
    return found


def _written(value: Any) -> str:
    if hasattr(value, "item"):  # a number of numpy's
        value = value.item()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    text = str(value)
    try:
        plain = text.isprintable() and ros_yaml.parse(text, "") == text
    except InvalidInputError:
        plain = False
    return text if plain else json.dumps(text)
