"""Trials of the laws of other packages: what motion and theory ask of them, at a few states.

A trial raises InvalidInputError for what does not fit, and whatever the law raises.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import product
from math import isfinite, isinf
from typing import Any

import numpy as np

from stickslip_ros.errors import InvalidInputError, in_words
from stickslip_ros.physics.model.constants import numbers, with_symbols
from stickslip_ros.physics.model.control import ControlLaw
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Coulomb, Directional, FrictionLaw

_Equations = Callable[[Any, Sequence[Any]], Iterable[Any]]
"""Equations of a part with the values of its variables, both as numbers or as expressions."""

_TOLERANCE = 1e-9
_DRIVE = Drive(2.0, 0.1, 3.0, 5.0, 0.4, Coulomb())
"""Drive in whose units a control is tried."""


def try_friction_law(law: FrictionLaw, *, symbols: bool = False) -> None:
    """Try a friction law with its constants as numbers, and on request also as symbols."""
    if isinstance(law, Directional):
        try_friction_law(law.forward)
        try_friction_law(law.reverse)
        return
    speed = law.characteristic_speed
    _must(speed > 0.0, f"its characteristic_speed is {speed} m/s, which must be above 0")
    unit, count = 1.0 if isinf(speed) else float(speed), len(law.states)
    law.warning()
    limits, in_other_units = (
        _finite("limits", law.limits, ("forward", "backward")),
        law.scaled(2.0, 3.0),
    )
    continuous = type(law).limits is FrictionLaw.limits

    def equations(part: Any, values: Sequence[Any]) -> Iterable[Any]:
        speed, sign, *rest = values
        given = speed, sign, rest[:count], rest[count:]
        own = part.friction(*given), *part.memory_rates(*given), *part.margins(*given)
        return (*own, part.creep_limit(*given[:3])) if law.rate_sensitivity else own

    points: list[Sequence[float]] = []
    for share, sign in product((0.1, 1.0, 10.0, 0.0)[: 3 if count else 4], (1.0, -1.0)):
        speed = sign * share * unit
        memory = _finite("memory_at", law.memory_at(speed, sign), law.states)
        switches = _finite("switches_at", law.switches_at(speed, sign, memory), law.switches)
        _finite("initial_memory", law.initial_memory(speed), law.states)
        _finite("memory_rates", law.memory_rates(speed, sign, memory, switches), law.states)
        points.append((speed, sign, *memory, *switches))
        _finite("equations", equations(law, points[-1]))
        forms = [
            law.coefficient(speed, sign),
            *law.coefficient(np.full(2, speed), np.full(2, sign)),
            in_other_units.coefficient(speed / 2.0, sign),
            *([] if count else [law.friction(speed, sign, memory, switches)]),
        ]
        found = _finite("coefficient", forms)
        _must(
            bool(np.ptp(found) <= _TOLERANCE * np.abs(found).max()),
            f"its coefficient at {speed:g} m/s is {found} for a number, for an array (2), in other "
            "units and as friction, which must be the same",
        )
        if share == 0.0:  # where slip starts
            size, limit = -sign * found[0], limits[sign < 0.0]
            least = limit if continuous else 0.0
            _must(
                least - _TOLERANCE <= size <= limit + _TOLERANCE,
                f"its coefficient(0, {sign:g}) is {found[0]}, which must be {-sign * limit}, "
                "as static or limits say",
            )
    if symbols:
        _try_symbols(law, equations, points[:6])


def try_control_law(law: ControlLaw, *, symbols: bool = False) -> None:
    """Try the equations of a control law, if any; its answers are checked at each sample."""
    linear = law.linear_feedback(1e-3)
    if linear is not None:
        n, shapes = len(linear.state), [np.shape(each) for each in linear]
        _must(
            shapes == [(n, n), (n, 2), (n,), (2,)] and all(np.isfinite(x).all() for x in linear),
            f"its linear_feedback has the shapes {shapes}, which must be (n, n), (n, 2), (n,) and "
            "(2,), of finite numbers",
        )
    control = law.continuous
    if control is None:
        return

    def equations(part: Any, values: Sequence[Any]) -> Iterable[Any]:
        x, y, *own = values
        return *part.state_rates(x, y, own), part.control_force(x, y, own)

    points: list[Sequence[float]] = []
    for x, y in ((0.1, 0.2), (-0.3, 0.4)):
        states = _finite("rest", control.rest(x, y), control.states)
        points.append((x, y, *(0.05 + state for state in states)))
    for part in (control, control.silenced(), control.scaled(_DRIVE)):
        _finite("continuous form", equations(part, points[0]), (*control.states, "force"))
    _finite("state_scales", control.state_scales(_DRIVE), control.states)
    np.broadcast_to(control.bound(np.ones(3)), 3)
    if symbols:
        _try_symbols(control, equations, points)


def _must(fits: bool, reason: str) -> None:
    if not fits:
        raise InvalidInputError(reason)


def _finite(
    name: str, values: Iterable[Any], each_of: Collection[str] | None = None
) -> list[float]:
    """Return values as floats, where given one for each of some names."""
    found = [float(each) for each in values]
    _must(all(map(isfinite, found)), f"its {name}: {found}, which must be finite numbers")
    if each_of is not None:
        known = tuple(each_of)
        _must(
            len(found) == len(known), f"its {name}: {found}, which must be one for each of {known}"
        )
    return found


def _try_symbols(part: Any, equations: _Equations, points: Sequence[Sequence[float]]) -> None:
    """Compare the equations of a part with those that heyoka compiles for the integrator."""
    import heyoka as hy  # only where a package has a law

    constants = dict(numbers(part, "constant"))
    symbols = {name: hy.expression(name) for name in constants}
    variables = [hy.expression(f"variable[{number}]") for number in range(len(points[0]))]
    try:
        found = equations(with_symbols(part, "constant", symbols), variables)
        given = [hy.expression(0.0) + each for each in found]
        compiled = hy.cfunc(given, [*symbols.values(), *variables])
    except Exception as error:
        raise InvalidInputError(f"cannot be an expression of heyoka: {in_words(error)}") from None
    for values in points:
        expected = _finite("equations", equations(part, values))
        got = compiled([*constants.values(), *values]).tolist()
        _must(
            np.allclose(got, expected, _TOLERANCE, _TOLERANCE),
            f"its equations give {got} as an expression of heyoka and {expected} with numbers, "
            "which must be the same",
        )
