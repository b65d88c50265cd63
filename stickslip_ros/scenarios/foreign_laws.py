"""The laws of other installed packages, found by their entry points and tried.

A trial asks a law what motion and theory ask of it, at a few states. It raises InvalidInputError
for what does not fit, and whatever the law raises.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from importlib.metadata import Distribution, EntryPoint, distributions
from inspect import isabstract
from itertools import product
from math import inf, isfinite, isinf
from typing import Any, Generic, TypeVar, cast

import numpy as np

from stickslip_ros.errors import InvalidInputError, in_words
from stickslip_ros.model.constants import (
    LARGEST,
    SMALLEST,
    Parameter,
    constants_of,
)
from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.model.control.base import seen_by
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    LAWS,
    Coulomb,
    CurveFollower,
    Directional,
    FrictionLaw,
)
from stickslip_ros.model.symbols import numbers, with_symbols
from stickslip_ros.scenarios.validation import ParameterGroup

_Law = TypeVar("_Law", bound=FrictionLaw | ControlLaw)
_Base = TypeVar("_Base")
_Equations = Callable[[Any, Sequence[Any]], Iterable[Any]]
"""Equations of a part with the values of its variables, both as numbers or as expressions."""

_TOLERANCE = 1e-9
_DRIVE = Drive(2.0, 0.1, 3.0, 5.0, 0.4, Coulomb())
"""Drive in whose units a control is tried."""


@dataclass
class LawFamily(Generic[_Law]):
    """The laws of one kind, to which other packages can add their own."""

    group: str
    """Entry point group in which other packages name their laws."""
    base: type[_Law]
    """Class from which every law derives."""
    laws: dict[str, type[_Law]]
    """Every law by its name."""
    reserved: Collection[str]
    """Names that no constant can have."""
    one_namespace: bool
    """Whether all laws have their constants in one group of parameters."""
    trial: Callable[..., None]
    """Tries a law, on request also with symbols for its constants; raises anything."""
    refused: dict[str, str] = field(default_factory=dict[str, str])
    """Reason of the refusal of each law of another package that is refused, by name."""

    def add(self, entry: EntryPoint, package: Distribution) -> None:
        """Add the law of an entry point, or the reason against it to `refused`."""
        try:
            law = loaded(entry, self.base)
            if self.laws.get(entry.name) is not law:  # the package can be on the path twice
                self._check(entry.name, law)
                self.laws[entry.name] = law
        except InvalidInputError as error:
            reason = f"{entry.value} of package {package.name} {error}"
            known = self.refused.get(entry.name)
            self.refused[entry.name] = f"{known}; {reason}" if known and known != reason else reason

    def _check(self, name: str, law: type[_Law]) -> None:
        """Refuse a law that cannot be one of `laws`."""
        if not (name.isascii() and name.isidentifier()):
            raise InvalidInputError(f"has the name {name!r}: must be of letters, digits and _")
        if name in self.laws:
            raise InvalidInputError(f"has the name of another law, {_place(self.laws[name])}")
        check_class(name, law)
        if not is_dataclass(law) or "__dataclass_fields__" not in vars(law):
            raise InvalidInputError("is no dataclass: must have @dataclass(frozen=True)")
        constants = constants_of(law)
        described = {*constants, "curve"} if issubclass(law, CurveFollower) else constants
        for each in law.constants():
            if each not in described:
                raise InvalidInputError(f"does not describe its constant {each} by `constant`")
        for constant in constants.values():
            self._check_constant(constant)
        try:
            made = law()
            if made.refusal() is None:
                self.trial(made, symbols=True)
        except (Exception, SystemExit) as error:
            raise InvalidInputError(f"fails with its defaults: {in_words(error)}") from None

    def made(self, make: Callable[[], _Law], *kinds: type[_Law]) -> _Law:
        """Return a law of these classes with its constants; those of other packages are tried.

        Raises ValueError with the reason if the constants do not fit together.
        """
        given = ""
        try:
            law = make()
            foreign = not all(kind.__module__.startswith("stickslip_ros.") for kind in kinds)
            if foreign:
                values = (f"{each.name} = {getattr(law, each.name)}" for each in fields(law))
                given = f" with {', '.join(values)}"
            refusal = law.refusal()
            if foreign and refusal is None:
                self.trial(law)
        except (Exception, SystemExit) as error:
            raise ValueError(f"law {kinds[0].name}{given} fails: {in_words(error)}") from None
        if refusal is not None:
            raise ValueError(refusal)
        return law

    def _check_constant(self, constant: Parameter) -> None:
        name, default = constant.name, constant.default
        if name in self.reserved or name.startswith("_") or not name.isascii():
            raise InvalidInputError(
                f"has a constant {name}: the name cannot be that of a parameter"
            )
        is_tuple = isinstance(default, tuple)
        if not is_tuple:
            self._check_default(constant, default)
        for law in self.laws.values() if self.one_namespace else ():
            known = constants_of(law).get(name)
            if known is not None and not (is_tuple and isinstance(known.default, tuple)):
                own, other = _one_for_all(constant), _one_for_all(known)
                different = [what for what in own if own[what] != other[what]]
                if different:
                    raise InvalidInputError(
                        f"has a constant {name} with "
                        + " and ".join(f"{what} {own[what]}" for what in different)
                        + f": must be {', '.join(other[what] for what in different)} "
                        f"as in law {law.name}, or have another name"
                    )

    def _check_default(self, constant: Parameter, default: Any) -> None:
        least = max(constant.at_least, SMALLEST if constant.positive else -LARGEST)
        number = isinstance(default, int if constant.whole else int | float)
        if not number or not (least <= default <= LARGEST or (isinf(default) and default > 0.0)):
            raise InvalidInputError(
                f"has the default {default!r} for its constant {constant.name}: must be a "
                f"{'whole ' if constant.whole else ''}number within its bounds"
            )


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
            shapes in ([(n, n), (n, m), (n,), (m,)] for m in (2, 4))
            and all(np.isfinite(x).all() for x in linear),
            f"its linear_feedback has the shapes {shapes}, which must be (n, n), (n, 2), (n,) and "
            "(2,), of finite numbers",
        )
    control = law.continuous
    if control is None:
        return

    def equations(part: Any, values: Sequence[Any]) -> Iterable[Any]:
        x, y, *own = values
        seen = seen_by(part, x, y, ())
        return *part.state_rates(*seen, own), part.control_force(*seen, own)

    points: list[Sequence[float]] = []
    for x, y in ((0.1, 0.2), (-0.3, 0.4)):
        states = _finite("rest", control.rest(*seen_by(control, x, y, ())), control.states)
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


FRICTION_LAWS = LawFamily(
    "stickslip_ros.friction_laws",
    FrictionLaw,
    LAWS,
    reserved={
        "law",
        "curve",
        "file",
        "points",
        "reverse",
        "selected",
        "names",
        "given",
        *dir(ParameterGroup),
    },
    one_namespace=True,
    trial=try_friction_law,
)
CONTROLLERS = LawFamily(
    "stickslip_ros.control_laws",
    ControlLaw,
    CONTROL_LAWS,
    reserved={
        "law", "node", "reference", "control_law", "as_controller",
        "autostart", "wait_for", "use_sim_time", "thread_priority", "cpu_affinity", "lock_memory",
        *dir(ParameterGroup),
    },
    one_namespace=False,
    trial=try_control_law,
)  # fmt: skip


def add_laws_of_other_packages() -> None:
    """Add the laws of other packages to their families, or the reasons against them."""
    families = {family.group: family for family in (FRICTION_LAWS, CONTROLLERS)}
    for entry, package in entries_of_other_packages(*families):
        families[entry.group].add(entry, package)


def entries_of_other_packages(*groups: str) -> list[tuple[EntryPoint, Distribution]]:
    """Return the entry points of groups with their packages, by name."""
    found = [
        (entry, package)
        for package in distributions()
        # Parsing the entry points takes longer.
        for text in [package.read_text("entry_points.txt") or ""]
        for group in groups
        if group in text
        for entry in package.entry_points.select(group=group)
    ]
    return sorted(found, key=lambda each: (each[0].name, each[0].value))


def loaded(entry: EntryPoint, base: type[_Base]) -> type[_Base]:
    """Return the class of an entry point; InvalidInputError if none derives from `base`."""
    try:
        found = entry.load()
    except (Exception, SystemExit) as error:  # the code of others: anything
        raise InvalidInputError(f"cannot be imported: {in_words(error)}") from None
    if not (isinstance(found, type) and issubclass(found, base)):
        raise InvalidInputError(f"is no class derived from {base.__name__}")
    return found


def check_class(name: str, kind: type) -> None:
    """Refuse a class that has another name than its entry point, or is abstract."""
    own = getattr(kind, "name", None)
    if own != name:
        raise InvalidInputError(
            f"has the name {own!r} in its class and {name!r} in its entry point: must be the same"
        )
    if isabstract(kind):
        missing = ", ".join(sorted(cast(Any, kind).__abstractmethods__))
        raise InvalidInputError(f"does not define {missing}")


def _one_for_all(constant: Parameter) -> Mapping[str, str]:
    """Return what must be the same for all constants of one name, in words."""
    bounds = [f"at least {constant.at_least:g}"] if constant.at_least > -inf else []
    bounds += ["above 0"] if constant.positive else []
    return {
        "unit": constant.unit or "none",
        "bounds": " and ".join(bounds) or "none",
        "default": repr(
            constant.default
            if constant.whole or isinstance(constant.default, tuple)
            else float(constant.default)
        ),
    }


def _place(law: type) -> str:
    return f"{law.__module__}.{law.__qualname__}"
