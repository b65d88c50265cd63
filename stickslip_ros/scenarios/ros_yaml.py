"""YAML as ROS reads it, which differs from PyYAML in some scalars."""

import re
from math import inf
from sys import float_info
from typing import Any, ClassVar

import yaml

from stickslip_ros.errors import InvalidInputError

_BOOLEANS = [
    spelling
    for word in ("true", "false", "yes", "no", "on", "off", "y", "n")
    for spelling in (word, word.capitalize(), word.upper())
]
_SCALARS = {
    "bool": "|".join(_BOOLEANS),
    "int": r"[-+]?(0|[1-9][0-9]*|0[0-7]+|0x[0-9a-fA-F]+)",
    "float": r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?"
    r"|[-+]?\.?(inf|Inf|INF)|[-+]?\.?(nan|NaN|NAN)",
    "null": "~|null|Null|NULL|",
}
_NUMBER = re.compile(f"(?:{_SCALARS['int']}|{_SCALARS['float']})")


def parse(text: str, source: str) -> Any:
    """Parse YAML; raise InvalidInputError, naming `source`, if it is invalid."""
    try:
        return yaml.load(text, Loader=_RosLoader)
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())
        raise InvalidInputError(f"{source} is not YAML: {reason}") from None
    except RecursionError:
        raise InvalidInputError(f"{source} cannot be read: it is nested too deeply") from None
    except (ArithmeticError, AttributeError, LookupError, ValueError):
        raise InvalidInputError(
            f"{source} is not YAML: a tag (!!) does not match its value"
        ) from None


def number_in(text: str) -> float | None:
    """Return the number that ROS reads in a text; None if it is not a number."""
    value = yaml.load(text, Loader=_RosLoader) if _NUMBER.fullmatch(text) else None
    return value if isinstance(value, int | float) else None


def dump(values: Any) -> str:
    """Return values as YAML with all strings quoted, so that no reader converts them."""
    return yaml.dump(values, Dumper=_QuotingDumper, sort_keys=False)


class _RosLoader(yaml.SafeLoader):
    """Loader that reads scalars as rcl does: 1e3 is a number, and there are no dates.

    Like rcl it refuses aliases, with which a small file could expand without bound.
    """

    bool_values: ClassVar[dict[str, bool]] = {**yaml.SafeLoader.bool_values, "y": True, "n": False}

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.YAMLError(f"aliases are not supported, line {event.start_mark.line + 1}")
        return super().compose_node(parent, index)


def _whole_number(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int | float | str:
    """Return an integer, beyond 64 bits a float, and beyond floats the text."""
    try:
        value = loader.construct_yaml_int(node)
        return value if -(2**63) <= value < 2**63 else float(value)
    except (ValueError, OverflowError):
        return str(node.value)


def _number(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> float | str:
    """Return a float, or the text of one that overflows or underflows."""
    text: str = node.value.lower()
    value = float(loader.construct_yaml_float(node))
    zero = not text.partition("e")[0].strip("+-.0")
    if zero or text.endswith(("inf", "nan")) or float_info.min <= abs(value) < inf:
        return value
    return str(node.value)


_RosLoader.add_constructor("tag:yaml.org,2002:int", _whole_number)
_RosLoader.add_constructor("tag:yaml.org,2002:float", _number)
_RosLoader.yaml_implicit_resolvers = {}
for _tag, _pattern in _SCALARS.items():
    _RosLoader.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), None
    )


class _QuotingDumper(yaml.SafeDumper):
    """Dumper that quotes every string, so that no reader converts it."""


_QuotingDumper.add_representer(
    str, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"')
)
