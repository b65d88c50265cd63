"""YAML as ROS reads it, which differs from YAML 1.1 in scalars, tags and keys."""

import re
from collections.abc import Iterator
from itertools import takewhile
from math import inf
from pathlib import Path
from sys import float_info
from typing import Any

import yaml

from stickslip_ros.errors import InvalidInputError

PARAMETERS_KEY = "ros__parameters"
Entry = tuple[tuple[str, ...], int, Any]
"""Keys, line and value."""

_TRUE = {"true", "True", "TRUE", "yes", "Yes", "YES", "on", "On", "ON", "y", "Y"}
_FALSE = {"false", "False", "FALSE", "no", "No", "NO", "off", "Off", "OFF", "n", "N"}
_WHOLE = re.compile(r"(?ai)\s*[-+]?(?:(0x)[0-9a-f]+|(0)[0-7]*|[1-9][0-9]{0,18})")
_NOT_FINITE = re.compile(
    r"(?a)\s*[-+]?(?i:inf|infinity|nan|nan\(\w*\))|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)
# ROS uses libyaml: with it, there is no difference in what a scalar is.
_LOADER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


class LineError(InvalidInputError):
    """A line of a file is refused."""

    def __init__(self, source: Path | str, line: int, reason: str) -> None:
        super().__init__(f"{source}, line {line}: {reason}")
        self.line = line


def entries(text: str, source: str) -> Iterator[Entry]:
    """Yield the scalars, lists and empty mappings in a YAML text.

    Raises LineError, naming `source`, for what ROS does not read. As in ROS, there are no aliases,
    with which a small file could expand without bound.
    """
    parsed = yaml.parse(text.encode(errors="surrogatepass"), _LOADER)
    # Documents and their ends do not matter, as in ROS.
    events = (e for e in parsed if isinstance(e, yaml.NodeEvent | yaml.CollectionEndEvent))
    try:
        for e in events:
            yield from _entries(events, e, ())
    except RecursionError:
        raise InvalidInputError(f"{source} cannot be read: it is nested too deeply") from None
    except yaml.MarkedYAMLError as error:
        mark: Any = error.problem_mark
        raise LineError(source, mark.line + 1, f"is not YAML for ROS: {error.problem}") from None
    except yaml.YAMLError:
        raise InvalidInputError(f"{source} is not YAML: a character is not allowed") from None


def parse(text: str, source: str) -> Any:
    """Return the value in a YAML text, None for an empty one; raise as `entries` does."""
    values = {".".join(keys): value for keys, _, value in entries(text, source)}
    return values.get("", values or None)


def number_in(text: str) -> float | None:
    """Return the number that ROS reads in a text; None if it is not a number."""
    value = _read(text)
    return None if isinstance(value, bool | str) else value


def dump(values: Any) -> str:
    """Return values as YAML with all strings quoted, so that no reader converts them."""
    return yaml.dump(values, Dumper=_QuotingDumper, sort_keys=False)


def _entries(events: Iterator[Any], event: Any, keys: tuple[str, ...]) -> Iterator[Entry]:
    """Yield what is in the value that `event` begins."""
    line = event.start_mark.line + 1
    inner = takewhile(lambda event: not isinstance(event, yaml.CollectionEndEvent), events)
    if isinstance(event, yaml.MappingStartEvent):
        names: list[str] = []
        for key in inner:
            if PARAMETERS_KEY in names:  # ROS would lose count of the names of nodes
                raise _problem(key, f"there must be nothing beside {PARAMETERS_KEY}")
            names.append(_text(key))
            yield from _entries(events, next(events), (*keys, names[-1]))
        if not names:
            yield keys, line, {}
    elif isinstance(event, yaml.SequenceStartEvent):
        values = [_scalar(item) for item in inner]
        if len({type(value) for value in values}) > 1:
            raise _problem(event, "the values of a list must be of one type")
        yield keys, line, values
    else:
        yield keys, line, _scalar(event)


def _scalar(event: Any) -> bool | float | str:
    text = _text(event)
    is_text = event.style in ("'", '"') or event.tag == "tag:yaml.org,2002:str"
    return text if is_text else _read(text)


def _text(event: Any) -> str:
    """Return the text of a key or scalar."""
    if not isinstance(event, yaml.ScalarEvent):
        raise _problem(event, "must be a scalar, and aliases are not supported")
    if "\0" in event.value or (not event.value and event.style not in ("'", '"')):
        raise _problem(event, "a value is missing, or has a null character")
    return event.value


def _read(text: str) -> bool | float | str:
    """Return what ROS reads in a scalar without quotes: what C reads, if it is a number."""
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if _NOT_FINITE.fullmatch(text):
        return float(text.replace(".", "").partition("(")[0])
    if whole := _WHOLE.fullmatch(text):
        value = int(text, 16 if whole[1] else 8 if whole[2] else 10)
        if -(2**63) <= value < 2**63:
            return value
    hexadecimal = "x" in text.lower()
    try:
        value = float.fromhex(text) if hexadecimal else float(text)
    except (OverflowError, ValueError):
        return text
    digits = text.lower().partition("p" if hexadecimal else "e")[0]
    in_range = float_info.min <= abs(value) < inf or not digits.strip("+-.0x")
    as_in_c = text.isascii() and "_" not in text and not text[-1].isspace()
    return value if in_range and as_in_c else text


def _problem(event: Any, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


class _QuotingDumper(yaml.SafeDumper):
    """Dumper that quotes every string, so that no reader converts it."""


_QuotingDumper.add_representer(
    str, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"')
)
