"""Quantities: what they are called and their units; and numbers with units as users write them."""

import re
from contextlib import suppress
from functools import cache
from sys import float_info
from typing import Any, NamedTuple, get_type_hints

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.text import shown

# All that pint gets to read: no arithmetic, and no large power.
_UNIT = r"[A-Za-zµμ]+(?: ?(?:\^|\*\*) ?-?\d|[²³])?"
_JOIN = r"(?: ?[*·/] ?| )"
_GROUP = rf"(?:{_UNIT}|\({_UNIT}(?:{_JOIN}{_UNIT})*\))"
QUANTITY = re.compile(
    r"(?a)(?=.{1,80}\Z)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)"
    rf"\s*((?:1?/ ?)?{_GROUP}(?:{_JOIN}{_GROUP})*)\s*"
)
"""A number and its unit."""


ROTARY = {
    "m": "rad",
    "m/s": "rad/s",
    "N": "N m",
    "N/s": "N m/s",
    "kg": "kg m^2",
    "N/m": "N m/rad",
    "N s/m": "N m s/rad",
    "s/m": "s/rad",
}
"""Units of a rotary axis by those of a linear one."""


class Quantity(NamedTuple):
    """What a value is, in tables, figures and on pages."""

    label: str
    unit: str = ""
    """SI unit; empty: none."""
    missing: str = ""
    """When the value does not exist."""


def quantities_of(kind: type) -> dict[str, Quantity]:
    """Return the quantities that the fields of a class are annotated with, by name."""
    hints = get_type_hints(kind, include_extras=True)
    annotated = {name: getattr(hint, "__metadata__", ()) for name, hint in hints.items()}
    return {name: metadata[0] for name, metadata in annotated.items() if metadata}


def number_of(name: str, given: Any, unit: str | None) -> float:
    """Return a number given in `unit`, or as a text with a unit that converts to it, or refuse."""
    match = QUANTITY.fullmatch(given) if isinstance(given, str) else None
    with suppress(OverflowError, TypeError, ValueError):
        if match is None:
            return float(given)
        if unit:
            return _converted(match[1], match[2], unit)
    allowed = f" in {unit}, or in a unit that converts to it" if unit else " without a unit"
    if isinstance(given, str) and "," in given:
        allowed = f" with a decimal point{allowed}"
    turns = "; Hz and rpm count turns, of 2 pi rad" if unit and "rad" in unit else ""
    raise InvalidInputError(f"{name} = {shown(given)} is invalid: must be a number{allowed}{turns}")


def _converted(number: str, given: str, unit: str) -> float:
    """Return a number of one unit in another one, rounded once; ValueError if there is none."""
    from fractions import Fraction

    from pint import PintError

    registry = _registry()
    with suppress(AssertionError, PintError, TypeError):  # ambiguous, unknown, logarithmic
        units = registry.parse_units(f"1{given}" if given[0] == "/" else given), unit
        value, offset = (registry.convert(Fraction(amount), *units) for amount in (number, 0))
        if not offset and (not value or float_info.min <= abs(value) <= float_info.max):
            return float(value)
    raise ValueError


@cache
def _registry() -> Any:
    from fractions import Fraction

    import pint

    create: Any = pint.UnitRegistry
    registry = create(None, non_int_type=Fraction, on_redefinition="ignore")
    registry.load_definitions(f"{pint.__path__[0]}/default_en.txt")  # by itself it would cache rpm
    for angle in ("radian", "turn"):  # numbers for pint, for which 1 Hz is 1 rad/s
        registry.define(f"{angle} = [{angle}]")
    return registry
