"""The description of a parameter: unit, bounds, default, meaning, and when it can change."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from math import ceil, inf, isinf, isnan
from typing import Any

from pydantic import BaseModel, Field
from pydantic.fields import FieldInfo

from stickslip_ros.physics.model.constants import Constant

SMALLEST, LARGEST = 1e-30, 1e30
"""Magnitudes, in SI units, between which no product or power in the physics overflows."""

_COMPARISONS = {"ge": "at least", "le": "at most"}
_UNTOLD = (LARGEST, 2**62)
"""Limits that only a mistake exceeds: tables and messages omit them."""


class Fixed(StrEnum):
    """State of the node from which a parameter cannot be changed."""

    NEVER = ""
    ACTIVE = "active"
    CONFIGURED = "configured"
    RUNNING = "running"

    @property
    def changes(self) -> str:
        """When the parameter can be changed, in words."""
        return {
            "": "at any time",
            "active": "while inactive",
            "configured": "before configured",
            "running": "at the start of the node",
        }[self]


def field(
    default: Any,
    meaning: str,
    unit: str | None = None,
    *,
    fixed: Fixed = Fixed.NEVER,
    choices: Iterable[str] = (),
    unset: str = "",
    file: bool = False,
    **bounds: Any,
) -> Any:
    """Describe a parameter; `unset` and `file` as in `Parameter`."""
    extra: Any = {
        "unit": unit,
        "fixed": fixed,
        "choices": tuple(choices),
        "unset": unset,
        "file": file,
    }
    if isinstance(default, float) and "allow_inf_nan" not in bounds:
        bounds = {"ge": -LARGEST, "le": LARGEST} | bounds
    return Field(default, description=meaning, json_schema_extra=extra, **bounds)


def field_of(constant: Constant, laws: list[str] | None = None, fixed: Fixed = Fixed.NEVER) -> Any:
    """Return type and description of a parameter for a constant, for some `laws` only."""
    meaning = constant.meaning
    if laws:
        meaning = f"{meaning.removesuffix('.')} ({', '.join(laws)})."
    least = max(constant.at_least, SMALLEST if constant.positive else -inf)
    bounds: dict[str, Any] = {} if least == -inf else {"ge": least}
    default: Any = constant.default
    if isinstance(default, StrEnum):
        kind = type(default)
        return kind, field(default, meaning, choices=kind, strict=False, fixed=fixed)
    if constant.whole:
        bounds = {bound: ceil(value) for bound, value in bounds.items()}
        return int, field(int(default), meaning, constant.unit, fixed=fixed, **bounds)
    if isnan(default):
        limits: dict[str, Any] = {"ge": -LARGEST, "le": LARGEST} | bounds
        return float, field(
            default, meaning, constant.unit, unset="as forward", allow_inf_nan=True, **limits
        )
    if isinf(default):
        bounds["allow_inf_nan"] = True
    return float, field(float(default), meaning, constant.unit, fixed=fixed, **bounds)


@dataclass(frozen=True)
class Parameter:
    """Description of one parameter."""

    name: str
    """Flat name, such as friction.static."""
    kind: type
    """bool, int, float, str or list (of str)."""
    default: Any
    unit: str | None
    meaning: str
    fixed: Fixed
    choices: tuple[str, ...]
    """Allowed values of a parameter of kind str; empty: any."""
    bounds: str
    """Allowed values in words, without the limits that only a mistake exceeds; empty: any."""
    limits: str
    """Allowed values in words, with these limits."""
    finite: bool
    """Whether a number must be finite."""
    range: tuple[float, float] | None
    """Smallest and largest value, if the parameter has both and at least one is its own."""
    least: float | None
    """Smallest value of a number, if it has one."""
    largest: float | None
    """Largest value of a number, if it has one."""
    unset: str = ""
    """Meaning of nan, in words; empty: nan is refused."""
    file: bool = False
    """Whether it is the path of a file, or empty."""

    def text(self, value: Any) -> str:
        """Return a value for a reader: nan as its meaning."""
        return self.unset if self.unset and isnan(value) else str(value)


def parameters_of(model: type[BaseModel], prefix: str = "") -> Iterator[Parameter]:
    """Yield the parameters of a node's model in order of definition."""
    for name, info in model.model_fields.items():
        kind = info.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from parameters_of(kind, f"{prefix}{name}.")
        else:
            yield _parameter(prefix + name, info)


@cache
def known_parameters(model: type[BaseModel]) -> Mapping[str, Parameter]:
    """Return the parameters of a node's model by flat name."""
    return {parameter.name: parameter for parameter in parameters_of(model)}


def _parameter(name: str, info: FieldInfo) -> Parameter:
    extra: Any = info.json_schema_extra
    choices = tuple(str(choice) for choice in extra["choices"])
    one_of = f"one of {', '.join(choices)}" if choices else ""
    kind: Any = str if choices else list if info.annotation == list[str] else info.annotation
    limits = {
        comparison: getattr(constraint, comparison)
        for constraint in info.metadata
        for comparison in _COMPARISONS
        if hasattr(constraint, comparison)
    }
    told = {name: limit for name, limit in limits.items() if abs(limit) not in _UNTOLD}
    unset = extra["unset"]
    return Parameter(
        name=name,
        kind=kind,
        default=str(info.default) if kind is str else info.default,
        unit=extra["unit"],
        meaning=info.description or "",
        fixed=extra["fixed"],
        choices=choices,
        bounds=one_of or _in_words(told).replace(f"at least {SMALLEST:g}", "above 0"),
        limits=one_of or _in_words(limits),
        finite=bool(unset)
        or not any(getattr(each, "allow_inf_nan", False) for each in info.metadata),
        # nan is in no range.
        range=(limits["ge"], limits["le"]) if told and len(limits) == 2 and not unset else None,
        least=limits.get("ge"),
        largest=limits.get("le"),
        unset=unset,
        file=extra["file"],
    )


def _in_words(limits: Mapping[str, Any]) -> str:
    return " and ".join(
        f"{_COMPARISONS[name]} {f'{limit:g}' if isinstance(limit, float) else limit}"
        for name, limit in limits.items()
    )
