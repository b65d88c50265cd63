"""Values of parameters that are refused: by what, and in which words."""

from contextlib import suppress
from math import inf, isfinite, isnan
from typing import Any

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import LARGEST, SMALLEST, Parameter
from stickslip_ros.text import shown

_KIND_NAMES = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a string",
    list: "a list of strings",
}


def checked(parameter: Parameter, value: Any) -> Any:
    """Return the value of a parameter, as its type.

    Raises InvalidInputError that names parameter, value and what is allowed.
    """
    kind = parameter.kind
    if parameter.choices:
        if isinstance(value, str) and value in parameter.choices:
            return parameter.choices[parameter.choices.index(value)]
    elif kind is float:
        if isinstance(value, int | float) and not isinstance(value, bool):
            with suppress(OverflowError):
                number = float(value)
                if parameter.unset and isnan(number):
                    return parameter.default
                if _within(parameter, number):
                    return number
    elif kind is int:
        if isinstance(value, int) and not isinstance(value, bool) and _within(parameter, value):
            return value
    elif kind is list:
        if isinstance(value, list) and all(isinstance(item, str) for item in value):
            return [*value]
    elif isinstance(value, kind):
        return value
    raise InvalidInputError(_refusal(parameter, value))


def _within(parameter: Parameter, number: float) -> bool:
    least, largest = parameter.least, parameter.largest
    return (
        (isfinite(number) or not (parameter.finite or isnan(number)))
        and (least is None or number >= least)
        and (largest is None or number <= largest)
    )


def _refusal(parameter: Parameter, value: Any) -> str:
    """Return one line on a value that is refused and what is allowed."""
    refused = f"{parameter.name} = {shown(value)} is invalid: "
    if isinstance(value, str) and value in parameter.refused:
        return refused + parameter.refused[value]
    kind = parameter.kind
    allowed = "a finite number" if kind is float and parameter.finite else _KIND_NAMES[kind]
    extreme = isinstance(value, int | float) and (
        LARGEST < abs(value) < inf or 0 < value < SMALLEST
    )
    bounds = parameter.limits if extreme else parameter.bounds
    if bounds:
        allowed = bounds if parameter.choices else f"{allowed} {bounds}"
    unit = f"{'' if bounds else ' in'} {parameter.unit}" if parameter.unit else ""
    if parameter.unset:
        unit += f", or nan ({parameter.unset})"
    text = ", not text" if isinstance(value, str) and kind is not str else ""
    return f"{refused}must be {allowed}{unit}{text}"
