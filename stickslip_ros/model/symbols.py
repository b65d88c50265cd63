"""The constants of a part as numbers by name, and as symbols of its equations."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from typing import Any

from stickslip_ros.model.constants import Parameter, constants_of


def numbers(part: Any, name: str) -> Iterator[tuple[str, float]]:
    """Yield name and value of each constant of a part, those of a table or a part of it, too.

    A number is one constant.
    """
    if isinstance(part, float):  # first: most are
        yield name, part
    elif is_dataclass(part):
        for own, each in _values(part).items():
            yield from numbers(each, f"{name}.{own}")
    elif isinstance(part, tuple):
        table: tuple[Any, ...] = part
        for number, each in enumerate(table):
            yield from numbers(each, f"{name}[{number}]")
    else:
        yield name, float(part)


def with_symbols(part: Any, name: str, symbols: Mapping[str, Any]) -> Any:
    """Return a part with the expressions of these names for its constants, see `numbers`."""
    if is_dataclass(part):
        inner = _values(part).items()
        found = {own: with_symbols(each, f"{name}.{own}", symbols) for own, each in inner}
        return replace(part, **found)  # type: ignore[type-var]
    if isinstance(part, tuple):
        return tuple(symbols[each] for each, _ in numbers(part, name))
    return symbols[name]


def structure(part: Any) -> Any:
    """Return what of a part, apart from the numbers in it, makes its equations; hashable."""
    if not is_dataclass(part):
        return part
    kind = type(part)
    if not _fields(kind):
        return kind
    found: list[Any] = [kind]
    for name, constant in _fields(kind):
        value = getattr(part, name)
        if constant is not None and (constant.whole or constant.simplifies):
            found.append(value if constant.stays(value) else None)
        elif isinstance(value, tuple):
            found.append(len(value) if constant is not None else None)
        elif not isinstance(value, (int, float)):
            found.append(structure(value))
    return tuple(found)


def _values(part: Any) -> dict[str, Any]:
    """Return the fields of a part that its equations have as symbols, by name.

    These are numbers, tuples of them, and parts with such fields. Tuples without a description are
    data from which switches are made.
    """
    found: dict[str, Any] = {}
    for name, constant in _fields(type(part)):
        value = getattr(part, name)
        if isinstance(value, (int, float)):
            varies = constant is None or not constant.stays(value)
        else:
            varies = is_dataclass(value) or (isinstance(value, tuple) and constant is not None)
        if varies:
            found[name] = value
    return found


@cache
def _fields(kind: type) -> tuple[tuple[str, Parameter | None], ...]:
    """Return the names of the fields of a class, each with its description if it has one."""
    constants = constants_of(kind)
    return tuple((each.name, constants.get(each.name)) for each in fields(kind))
