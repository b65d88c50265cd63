"""The friction laws of other installed packages, found by their entry points."""

from collections.abc import Mapping
from dataclasses import is_dataclass
from importlib.metadata import Distribution, EntryPoint, distributions
from inspect import isabstract
from math import inf
from typing import Any, cast

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.constants import Constant, constants_of
from stickslip_ros.physics.model.friction import LAWS, FrictionLaw
from stickslip_ros.scenarios.parameter_field import LARGEST, SMALLEST
from stickslip_ros.scenarios.validation import ParameterGroup

ENTRY_POINTS = "stickslip_ros.friction_laws"
"""Entry point group in which other packages name their laws."""

REFUSED_LAWS: dict[str, str] = {}
"""Reason of the refusal of each law of another package that is refused, by name."""

_RESERVED = {"law", "as_law", *dir(ParameterGroup)}


def add_laws_of_other_packages() -> None:
    """Add the laws of other packages to `LAWS`, or the reason against one to `REFUSED_LAWS`."""
    found = [
        (entry, package)
        for package in distributions()
        if ENTRY_POINTS in (package.read_text("entry_points.txt") or "")  # parsing takes longer
        for entry in package.entry_points.select(group=ENTRY_POINTS)
    ]
    for entry, package in sorted(found, key=lambda each: (each[0].name, each[0].value)):
        _add(entry, package)


def _add(entry: EntryPoint, package: Distribution) -> None:
    try:
        law = _loaded(entry)
        if LAWS.get(entry.name) is not law:  # the package can be on the path twice
            _check(entry.name, law)
            LAWS[entry.name] = law
    except InvalidInputError as error:
        reason = f"{entry.value} of package {package.name} {error}"
        known = REFUSED_LAWS.get(entry.name)
        REFUSED_LAWS[entry.name] = f"{known}; {reason}" if known and known != reason else reason


def _loaded(entry: EntryPoint) -> type[FrictionLaw]:
    try:
        law = entry.load()
    except (Exception, SystemExit) as error:  # the code of others: anything
        raise InvalidInputError(f"cannot be imported: {_in_words(error)}") from None
    if not (isinstance(law, type) and issubclass(law, FrictionLaw)):
        raise InvalidInputError("is no class derived from FrictionLaw")
    return law


def _check(name: str, law: type[FrictionLaw]) -> None:
    """Refuse a law that cannot be one of `LAWS`."""
    if not (name.isascii() and name.isidentifier()):
        raise InvalidInputError(f"has the name {name!r}: must be of letters, digits and _")
    if name in LAWS:
        raise InvalidInputError(f"has the name of another law, {_place(LAWS[name])}")
    if getattr(law, "name", None) != name:
        raise InvalidInputError(
            f"has the name {getattr(law, 'name', None)!r} in its class and {name!r} in its entry "
            "point: must be the same"
        )
    if isabstract(law):
        missing = ", ".join(sorted(cast(Any, law).__abstractmethods__))
        raise InvalidInputError(f"does not define {missing}")
    if not is_dataclass(law) or "__dataclass_fields__" not in vars(law):
        raise InvalidInputError("is no dataclass: must have @dataclass(frozen=True)")
    constants = constants_of(law)
    for each in law.constants():
        if each not in constants:
            raise InvalidInputError(f"does not describe its constant {each} by `constant`")
    for constant in constants.values():
        _check_constant(constant)
    try:
        law().refusal()
    except Exception as error:
        raise InvalidInputError(f"cannot be made from its defaults: {_in_words(error)}") from None


def _check_constant(constant: Constant) -> None:
    name, default = constant.name, constant.default
    if name in _RESERVED or name.startswith("_") or not name.isascii():
        raise InvalidInputError(f"has a constant {name}: the name cannot be that of a parameter")
    if isinstance(default, tuple):
        return
    least = max(constant.at_least, SMALLEST if constant.positive else -LARGEST)
    if not isinstance(cast(Any, default), int | float) or not least <= default <= LARGEST:
        raise InvalidInputError(
            f"has the default {default!r} for its constant {name}: must be a number within its "
            "bounds"
        )
    for law in LAWS.values():
        known = constants_of(law).get(name)
        if known is not None:
            own, other = _one_for_all(constant), _one_for_all(known)
            different = [what for what in own if own[what] != other[what]]
            if different:
                raise InvalidInputError(
                    f"has a constant {name} with "
                    + " and ".join(f"{what} {own[what]}" for what in different)
                    + f": must be {', '.join(other[what] for what in different)} "
                    f"as in law {law.name}, or have another name"
                )


def _one_for_all(constant: Constant) -> Mapping[str, str]:
    """Return what must be the same for all constants of one name, in words."""
    bounds = [f"at least {constant.at_least:g}"] if constant.at_least > -inf else []
    bounds += ["above 0"] if constant.positive else []
    return {
        "unit": constant.unit or "none",
        "bounds": " and ".join(bounds) or "none",
        "default": repr(constant.default if constant.whole else float(cast(Any, constant.default))),
    }


def _place(law: type[FrictionLaw]) -> str:
    return f"{law.__module__}.{law.__qualname__}"


def _in_words(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".removesuffix(": ")
