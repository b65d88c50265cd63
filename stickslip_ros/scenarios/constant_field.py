"""The parameters for the constants of laws and parts: one for each, from its description."""

from enum import StrEnum
from math import ceil, inf, isinf, isnan
from typing import Any

from pydantic import create_model

from stickslip_ros.physics.model.constants import Constant, constants_of
from stickslip_ros.scenarios.parameter_field import LARGEST, SMALLEST, Fixed, field
from stickslip_ros.scenarios.validation import ParameterGroup


def group_of(part: type, fixed: Fixed) -> type[ParameterGroup]:
    """Return the parameters for the constants of a part of the plant."""
    constants = constants_of(part).items()
    described: dict[str, Any] = {name: field_of(each, fixed=fixed) for name, each in constants}
    return create_model(part.__name__, __base__=ParameterGroup, **described)


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
