"""Units of the columns of a table: in their names or in a line of their own."""

import re
from collections.abc import Sequence
from contextlib import suppress

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.quantities import number_of

_BRACKETED = re.compile(r"(.+?)\s*[\[(<{]\s*(.+?)\s*[\])>}]\s*")
_SUFFIX = re.compile(r".+_((?:ns|us|µs|ms|nm|um|µm|mm|cm|mN|kN|deg)(?:_s)?)")
NO_UNITS = ("", "-", "unit", "units", "einheit", "einheiten")
_KINDS_OF_UNITS = ("s", "m", "m/s", "m/s^2", "N", "N m", "rad", "rad/s", "A", "V", "K", "Hz", "W")


def are_units(cells: Sequence[str]) -> bool:
    """Return whether the cells of a line are units, but for those that say so or are empty."""
    units = [cell.strip("[]()") for cell in cells if cell.strip("[]()").lower() not in NO_UNITS]
    known = sum(any(unit_factor(unit, kind) for kind in _KINDS_OF_UNITS) for unit in units)
    return 2 * known > len(units)


def unit_of(name: str) -> str:
    """Return the unit in the name of a column, in brackets or at its end, or nothing."""
    if found := _BRACKETED.fullmatch(name):
        return found[2]
    found = _SUFFIX.fullmatch(name)
    return found[1].replace("_s", "/s") if found else ""


def without_unit(name: str) -> str:
    """Return the name of a column without the unit in brackets, or nothing if it has none."""
    found = _BRACKETED.fullmatch(name)
    return found[1] if found else ""


def unit_factor(unit: str, target: str) -> float | None:
    """Return by what numbers of a unit are multiplied for another one, or None.

    There is none for a unit of another kind. Of a text such as `mm ±1 µm` it is the first unit.
    """
    unit = unit.strip("[]() ").replace("°", "deg").replace("Nm", "N m")
    for each in (unit, unit.partition(" ")[0]):
        with suppress(InvalidInputError):
            if each[:1].isalpha() or each[:2] == "1/":
                return number_of("unit", f"1 {each}", target)
    return None
