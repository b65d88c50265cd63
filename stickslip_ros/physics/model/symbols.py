"""Parts of a drive with expressions for their constants."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from typing import Any, TypeVar

from stickslip_ros.physics.model.constants import constants_of

_Part = TypeVar("_Part")


def numbers(part: Any, prefix: str) -> dict[str, float]:
    """Return the constants of a part by name; those of a table one by one."""
    if not _fields(type(part)):
        return {}
    return {
        name: number
        for field, value in _values(part).items()
        for name, number in _items(f"{prefix}.{field}", value).items()
    }


def with_symbols(part: _Part, prefix: str, symbols: Mapping[str, Any]) -> _Part:
    """Return a part with the expressions of these names for its constants, see `numbers`."""
    changes: dict[str, Any] = {}
    for field, value in _values(part).items():
        found = [symbols[name] for name in _items(f"{prefix}.{field}", value)]
        changes[field] = tuple(found) if isinstance(value, tuple) else found[0]
    return replace(part, **changes)  # type: ignore[type-var]


def structure(part: Any) -> Any:
    """Return what of a part, apart from the numbers in it, makes its equations; hashable."""
    if not is_dataclass(part):
        return part
    kind = type(part)
    if not _fields(kind):
        return kind
    found: list[Any] = [kind]
    for name, whole in _fields(kind):
        value = getattr(part, name)
        if isinstance(value, tuple) and not whole:
            found.append(len(value))
        elif whole or not isinstance(value, int | float):
            found.append(structure(value))
    return tuple(found)


def _values(part: Any) -> dict[str, Any]:
    """Return the fields of a part that are numbers, or tuples of them, by name.

    Whole numbers, such as the number of elements, are no constants of the equations.
    """
    return {
        name: value
        for name, whole in _fields(type(part))
        if not whole and isinstance(value := getattr(part, name), int | float | tuple)
    }


@cache
def _fields(kind: type) -> tuple[tuple[str, bool], ...]:
    """Return the names of the fields of a class, and whether each is a whole number."""
    constants = constants_of(kind)
    return tuple(
        (each.name, each.name in constants and constants[each.name].whole) for each in fields(kind)
    )


def _items(name: str, value: Any) -> dict[str, float]:
    """Return a number, or the items of a tuple, by name."""
    if not isinstance(value, tuple):
        return {name: float(value)}
    items: tuple[float, ...] = value
    return {f"{name}[{number}]": float(each) for number, each in enumerate(items)}
