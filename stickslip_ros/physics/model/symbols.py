"""Parts of a drive with expressions for their constants."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from typing import Any, TypeVar

from stickslip_ros.physics.model.constants import Constant, constants_of

_Part = TypeVar("_Part")


def numbers(part: Any, prefix: str) -> dict[str, float]:
    """Return the constants of a part by name; those of a table or of a part of it one by one."""
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
        own = f"{prefix}.{field}"
        if is_dataclass(value):
            changes[field] = with_symbols(value, own, symbols)
            continue
        found = [symbols[name] for name in _items(own, value)]
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
    for name, constant in _fields(kind):
        value = getattr(part, name)
        if constant is not None and (constant.whole or constant.simplifies):
            found.append(value if constant.stays(value) else None)
        elif isinstance(value, tuple):
            found.append(len(value) if constant is not None else None)
        elif not isinstance(value, int | float):
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
        if isinstance(value, int | float):
            plain = constant is None or not (constant.whole or constant.simplifies)
            if plain or constant is None or not constant.stays(value):
                found[name] = value
        elif isinstance(value, tuple):
            if constant is not None:
                found[name] = value
        elif is_dataclass(value):
            found[name] = value
    return found


@cache
def _fields(kind: type) -> tuple[tuple[str, Constant | None], ...]:
    """Return the names of the fields of a class, each with its description if it has one."""
    constants = constants_of(kind)
    return tuple((each.name, constants.get(each.name)) for each in fields(kind))


def _items(name: str, value: Any) -> dict[str, float]:
    """Return a number, or those of a tuple or of a part, by name."""
    if is_dataclass(value):
        return numbers(value, name)
    if not isinstance(value, tuple):
        return {name: float(value)}
    items: tuple[float, ...] = value
    return {f"{name}[{number}]": float(each) for number, each in enumerate(items)}
