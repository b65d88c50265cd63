"""Good and bad values for any parameter, derived from its model."""

import re
import struct
from math import inf, nan
from typing import Any

from stickslip_ros.model.constants import Parameter
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, ReplayParameters

MODELS = {**NODE_PARAMETERS, "replay": ReplayParameters()}

OF_EVERY_TYPE: list[Any] = [None, True, 7, 0.5, "no such word", [True], [7], [0.5], [b"\1"]]
"""One value of each type that ROS knows, a list of strings excepted."""

EXTREMES = [0.0, -0.0, 5e-324, -5e-324, 1e-310, 1e-30, -1.0, 100.0, 200.0]
EXTREMES += [1e30, 1.1e30, -1e308, 1e308, inf, -inf]

UNKNOWN: dict[str, Any] = {
    "": 1.0,
    "masss": 1.0,
    "friction": 0.4,
    "friction.": 0.4,
    ".mass": 1.0,
    "mass.kg": 1.0,
    "MASS": 1.0,
    "qos_overrides./joint_states.publisher.depth": 1,
    "x" * 10_000: 1.0,
}
"""Names that no parameter has, among them such as are part of one."""


CONFLICTS = (
    "must not exceed",
    "at least a thousandth",
    "must be 0 or at least",
    "must be above 0 and finite for a ",
    "must be the path of a CSV file",
    "must be at least friction.",
    "must be 0 with velocity = difference",
    "command_rule must be newest",
)
"""Why a value is refused that is good, but not with the others."""


def bits(value: Any) -> Any:
    """Return what tells -0.0 from 0.0."""
    return struct.pack("d", value) if isinstance(value, float) else value


def bad_values(parameter: Parameter) -> list[Any]:
    """Return values that must be refused: of another type, not finite, or out of bounds."""
    kinds = {parameter.kind, int} if parameter.kind is float else {parameter.kind}
    bad = [value for value in OF_EVERY_TYPE if type(value) not in kinds - {list}]
    if parameter.kind is float:
        bad += [] if parameter.unset else [nan]
        bad += [*(value for value in EXTREMES if not _allowed(parameter, value))]
    elif parameter.kind is int:
        bad += [value for value in (-1, 2**63 - 1, -(2**63)) if not _allowed(parameter, value)]
    elif parameter.choices:
        bad += ["", "no such word", parameter.choices[0].upper(), "x" * 100_000]
    elif parameter.kind is list:
        bad += [[7, 8]]
    return bad


def good_values(parameter: Parameter) -> list[Any]:
    """Return values within the bounds, the most extreme ones among them."""
    if parameter.kind is bool:
        return [True, False]
    if parameter.choices:
        return list(parameter.choices)
    if parameter.kind is float:
        return [value for value in EXTREMES if _allowed(parameter, value)]
    if parameter.kind is int:
        return [value for value in (0, 1, 200, 1000, 2**62) if _allowed(parameter, value)]
    return [parameter.default]


def _allowed(parameter: Parameter, value: float) -> bool:
    if abs(value) == inf and parameter.finite:
        return False
    limits = {
        words: float(limit)
        for words, limit in re.findall(r"(at \w+|below) (\S+)", parameter.limits)
    }
    if value >= limits.get("below", nan):
        return False
    return limits.get("at least", -inf) <= value <= limits.get("at most", inf)
