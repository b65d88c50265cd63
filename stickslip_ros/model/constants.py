"""The description of a parameter, and the units of the constants of a drive."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import StrEnum
from functools import cache, cached_property, partial
from math import ceil, inf, isinf, isnan, nextafter
from typing import Any, TypeVar

_Part = TypeVar("_Part")

SMALLEST, LARGEST = 1e-30, 1e30
"""Magnitudes, in SI units, between which no product or power in the physics overflows."""

MOST_STEPS = 2.0**53
"""Number of steps of a resolution from which on floats are coarser than the steps."""

_KEY = "constant"
_OMITTED_LIMITS = (LARGEST, 2**62)
"""Limits that only a mistake exceeds: tables and messages omit them."""

_BASE_UNITS: Mapping[str, tuple[int, int, int]] = {
    "m": (1, 0, 0),
    "s": (0, 1, 0),
    "N": (0, 0, 1),
    "kg": (-1, 2, 1),
    "Hz": (0, -1, 0),
    "rad": (0, 0, 0),
    "1": (0, 0, 0),
    "samples": (0, 0, 0),
    "cycles": (0, 0, 0),
    "bytes": (0, 0, 0),
}
"""Powers of length, time and force in each unit."""


class Changes(StrEnum):
    """When a parameter can be changed, in words."""

    LIVE = "at any time"
    AT_REST = "while inactive"
    AT_BUILD = "before configured"
    AT_START = "at the start of the node"


@dataclass(frozen=True)
class Parameter:
    """Description of one parameter: of a constant of a part, or of an option of a node."""

    name: str
    """Name of the field; of a parameter of a node the flat name, such as friction.static."""
    default: Any
    """Default value; a tuple of numbers for a table."""
    meaning: str
    """Meaning, as a sentence."""
    unit: str | None = None
    """Unit, such as "N s/m"; None for a pure number."""
    at_least: float = -inf
    """Smallest allowed value."""
    at_most: float = inf
    """Largest allowed value."""
    below: float = inf
    """Value that it must be below."""
    positive: bool = False
    """Whether the value must be above zero."""
    whole: bool = False
    """Whether it is a whole number; one that makes the equations, such as a number of elements.

    It stays a number in the symbolic equations.
    """
    simplifies: bool = False
    """Whether whole values simplify the equations, such as a factor of 0 or an exponent of 1 or 2.

    They stay numbers in the symbolic equations.
    """
    changes: Changes = Changes.LIVE
    """When it can be changed."""
    choices: tuple[str, ...] = ()
    """Allowed values of a text; empty: any."""
    refused: Mapping[str, str] = field(default_factory=dict[str, str])
    """Reasons against some values of a text, by value."""
    unset: str = ""
    """Meaning of nan, in words; empty: nan is refused."""
    file: bool = False
    """Whether it is the path of a file, or empty."""

    @cached_property
    def kind(self) -> type:
        """Type: bool, int, float, str or list (of str)."""
        if isinstance(self.default, bool | str | list):
            return type(self.default)
        return int if self.whole else float

    @cached_property
    def finite(self) -> bool:
        """Whether a number must be finite."""
        return self.kind is not float or not isinf(self.default)

    @cached_property
    def least(self) -> float | None:
        """Smallest value of a number, if it has one."""
        least = max(self.at_least, SMALLEST if self.positive else -inf)
        if least == -inf:
            return -LARGEST if self.kind is float and self.finite else None
        return ceil(least) if self.whole else least

    @cached_property
    def largest(self) -> float | None:
        """Largest value of a number, if it has one."""
        largest = min(self.at_most, nextafter(self.below, -inf) if self.below < inf else inf)
        if largest == inf:
            return LARGEST if self.kind is float and self.finite else None
        return largest

    @property
    def bounds(self) -> str:
        """Allowed values in words, without the limits that only a mistake exceeds; empty: any."""
        return self._in_words(self._stated).replace(f"at least {SMALLEST:g}", "above 0")

    @property
    def limits(self) -> str:
        """Allowed values in words, with these limits."""
        return self._in_words(self._limits)

    @property
    def range(self) -> tuple[float, float] | None:
        """Smallest and largest value, if the parameter has both and at least one is its own."""
        least, largest = self.least, self.largest
        # nan is in no range.
        if not self._stated or least is None or largest is None or self.unset:
            return None
        return least, largest

    def is_default(self, value: Any) -> bool:
        """Return whether a value is the default; nan is nan.

        Parameters
        ----------
        value : bool, int, float, str or list of str
            Value of the parameter.
        """
        return value == self.default or (value != value and self.default != self.default)

    def stays(self, value: Any) -> bool:
        """Return whether a value stays a number in the symbolic equations.

        Parameters
        ----------
        value : float or expression
            Value of the constant.

        Returns
        -------
        bool
            True for a whole number that makes or simplifies the equations.
        """
        return self.whole or (
            self.simplifies and isinstance(value, int | float) and float(value).is_integer()
        )

    def text(self, value: Any) -> str:
        """Return a value for a reader: nan as its meaning.

        Parameters
        ----------
        value : float
            Value of the parameter.

        Returns
        -------
        str
            The value, or what nan means for this parameter.
        """
        return self.unset if self.unset and isnan(value) else str(value)

    @property
    def _limits(self) -> dict[str, float]:
        upper = {"below": self.below} if self.below < inf else {"at most": self.largest}
        limits = {"at least": self.least, **upper}
        return {word: limit for word, limit in limits.items() if limit is not None}

    @property
    def _stated(self) -> dict[str, float]:
        return {
            word: limit for word, limit in self._limits.items() if abs(limit) not in _OMITTED_LIMITS
        }

    def _in_words(self, limits: Mapping[str, float]) -> str:
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        return " and ".join(
            f"{word} {f'{limit:g}' if isinstance(limit, float) else limit}"
            for word, limit in limits.items()
        )


def constant(
    default: Any,
    meaning: str,
    unit: str | None = None,
    *,
    choices: Iterable[str] = (),
    **attributes: Any,
) -> Any:
    """Describe a constant, or an option of a node, as the default of a dataclass field.

    Parameters
    ----------
    default : float, tuple of float, str, bool, list of str or StrEnum
        Default value; a tuple for a table, a member of an enumeration for a choice.
    meaning : str
        Meaning, as a sentence; shown in help texts and in the documentation.
    unit : str, optional
        Unit of m, s, N, kg, Hz and rad, such as "N s/m" or "N/(m s)"; the scaling derives from it.
        By default the constant is a pure number.
    choices : iterable of str, optional
        Allowed values of a text; those of an enumeration are known.
    **attributes
        Bounds, and what else there is to say: further attributes of `Parameter`, by name.

    Returns
    -------
    dataclasses.Field
        Field with this description.

    Raises
    ------
    ValueError
        If the unit is unknown.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from stickslip_ros.model.constants import constant, constants_of
    >>> @dataclass(frozen=True)
    ... class Spring:
    ...     stiffness: float = constant(1.0, "Stiffness of the spring.", "N/m", positive=True)
    >>> constants_of(Spring)["stiffness"].unit
    'N/m'
    """
    unit_powers(unit)
    known = default
    if isinstance(default, StrEnum):
        choices, known = list(type(default)), str(default)
    elif type(default) is int and not attributes.get("whole") and abs(default) <= LARGEST:
        known = float(default)
    choices = tuple(choices)
    described = Parameter("", known, meaning, unit, choices=choices, **attributes)
    metadata = {_KEY: described}
    if isinstance(default, list):
        return field(default_factory=default.copy, metadata=metadata)
    return field(default=default, metadata=metadata)


at_rest = partial(constant, changes=Changes.AT_REST)
"""Describe an option of a node that can be changed while it is inactive; see `constant`."""
at_build = partial(constant, changes=Changes.AT_BUILD)
"""Describe an option of a node that can be changed before it is configured; see `constant`."""


def described_by(parameter: Parameter) -> Any:
    """Return a dataclass field with the description and the default of a parameter."""
    return field(default=parameter.default, metadata={_KEY: parameter})


@cache
def constants_of(part: type) -> Mapping[str, Parameter]:
    """Return the constants of a part's class, a dataclass, by name, in the order of the fields."""
    return {
        attribute.name: replace(attribute.metadata[_KEY], name=attribute.name)
        for attribute in fields(part)
        if _KEY in attribute.metadata
    }


def parameters_of(part: Any, prefix: str = "") -> Iterator[Parameter]:
    """Yield the constants of a part, and of the parts in it under their flat names, in order."""
    for attribute in fields(part):
        name, value = f"{prefix}{attribute.name}", getattr(part, attribute.name)
        if _KEY in attribute.metadata:
            yield replace(attribute.metadata[_KEY], name=name)
        elif is_dataclass(value):
            yield from parameters_of(value, f"{name}.")


@dataclass(frozen=True)
class Scales:
    """Units in which a drive is dimensionless."""

    length: float
    """Unit of length, m."""
    speed: float
    """Unit of speed, m/s."""
    force: float = 1.0
    """Unit of force, N."""

    def factor(self, unit: str | None) -> float:
        """Return the factor from SI units to dimensionless values."""
        length, time, force = unit_powers(unit)
        if length == -time:  # a power of a speed
            return self.speed**-length * self.force**-force
        return self.length ** (-length - time) * self.speed**time * self.force**-force


def scaled(part: _Part, scales: Scales) -> _Part:
    """Return a part with its constants in units of `scales`."""
    changes = {
        name: _times(getattr(part, name), scales.factor(described.unit))
        for name, described in constants_of(type(part)).items()
        if described.unit is not None
    }
    return replace(part, **changes) if changes else part  # type: ignore[type-var]


def _times(value: Any, factor: float) -> Any:
    return tuple(size * factor for size in value) if isinstance(value, tuple) else value * factor


@cache
def unit_powers(unit: str | None) -> tuple[int, int, int]:
    """Return the powers of length, time and force in a unit."""
    total = [0, 0, 0]
    for sign, name, power in _factors(unit or "1"):
        if name not in _BASE_UNITS:
            raise ValueError(f"unit {unit!r}: {name!r} is none of {', '.join(_BASE_UNITS)}")
        for axis, base in enumerate(_BASE_UNITS[name]):
            total[axis] += sign * power * base
    return total[0], total[1], total[2]


def _factors(unit: str) -> Iterator[tuple[int, str, int]]:
    """Yield sign, name and power of each factor; everything after a slash is divided by."""
    numerator, *denominators = re.sub(r"/\(([^()/]+)\)", r"/\1", unit).split("/")
    for sign, part in ((1, numerator), *((-1, denominator) for denominator in denominators)):
        for factor in part.split():
            name, _, power = factor.partition("^")
            if not re.fullmatch(r"\d*", power):
                raise ValueError(f"unit {unit!r}: the power of {name} must be a whole number")
            yield sign, name, int(power or 1)
