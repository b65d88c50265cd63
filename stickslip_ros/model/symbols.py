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
        for field, constant in _values(part).items():
            yield from numbers(constant, f"{name}.{field}")
    elif isinstance(part, tuple):
        table: tuple[Any, ...] = part
        for number, element in enumerate(table):
            yield from numbers(element, f"{name}[{number}]")
    else:
        yield name, float(part)


def with_symbols(part: Any, name: str, symbols: Mapping[str, Any]) -> Any:
    """Return a part with the expressions of these names for its constants, see `numbers`."""
    if is_dataclass(part):
        inner = _values(part).items()
        parts = {
            field: with_symbols(constant, f"{name}.{field}", symbols) for field, constant in inner
        }
        return replace(part, **parts)  # type: ignore[type-var]
    if isinstance(part, tuple):
        return tuple(symbols[constant_name] for constant_name, _ in numbers(part, name))
    return symbols[name]


def structure(part: Any) -> Any:
    """Return what of a part, apart from the numbers in it, makes its equations; hashable."""
    if not is_dataclass(part):
        return part
    kind = type(part)
    if not _fields(kind):
        return kind
    parts: list[Any] = [kind]
    for name, constant in _fields(kind):
        value = getattr(part, name)
        if constant is not None and (constant.whole or constant.simplifies):
            parts.append(value if constant.stays(value) else None)
        elif isinstance(value, tuple):
            parts.append(len(value) if constant is not None else None)
        elif not isinstance(value, (int, float)):
            parts.append(structure(value))
    return tuple(parts)


def _values(part: Any) -> dict[str, Any]:
    """Return the fields of a part that its equations have as symbols, by name.

    These are numbers, tuples of them, and parts with such fields. Tuples without a description are
    data from which switches are made.
    """
    constants: dict[str, Any] = {}
    for name, constant in _fields(type(part)):
        value = getattr(part, name)
        if isinstance(value, (int, float)):
            varies = constant is None or not constant.stays(value)
        else:
            varies = is_dataclass(value) or (isinstance(value, tuple) and constant is not None)
        if varies:
            constants[name] = value
    return constants


@cache
def _fields(kind: type) -> tuple[tuple[str, Parameter | None], ...]:
    """Return the names of the fields of a class, each with its description if it has one."""
    constants = constants_of(kind)
    return tuple((field.name, constants.get(field.name)) for field in fields(kind))
