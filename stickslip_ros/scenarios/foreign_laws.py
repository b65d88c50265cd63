"""The laws of other installed packages, found by their entry points."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from importlib.metadata import Distribution, EntryPoint, distributions
from inspect import isabstract
from math import inf, isinf
from typing import Any, Generic, TypeVar, cast

from stickslip_ros.errors import InvalidInputError, in_words
from stickslip_ros.physics.model.constants import LARGEST, SMALLEST, Parameter, constants_of
from stickslip_ros.physics.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.physics.model.friction import LAWS, CurveFollower, FrictionLaw
from stickslip_ros.scenarios.law_trial import try_control_law, try_friction_law
from stickslip_ros.scenarios.validation import ParameterGroup

_Law = TypeVar("_Law", bound=FrictionLaw | ControlLaw)


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
            law = self._loaded(entry)
            if self.laws.get(entry.name) is not law:  # the package can be on the path twice
                self._check(entry.name, law)
                self.laws[entry.name] = law
        except InvalidInputError as error:
            reason = f"{entry.value} of package {package.name} {error}"
            known = self.refused.get(entry.name)
            self.refused[entry.name] = f"{known}; {reason}" if known and known != reason else reason

    def _loaded(self, entry: EntryPoint) -> type[_Law]:
        try:
            law = entry.load()
        except (Exception, SystemExit) as error:  # the code of others: anything
            raise InvalidInputError(f"cannot be imported: {in_words(error)}") from None
        if not (isinstance(law, type) and issubclass(law, self.base)):
            raise InvalidInputError(f"is no class derived from {self.base.__name__}")
        return law

    def _check(self, name: str, law: type[_Law]) -> None:
        """Refuse a law that cannot be one of `laws`."""
        if not (name.isascii() and name.isidentifier()):
            raise InvalidInputError(f"has the name {name!r}: must be of letters, digits and _")
        if name in self.laws:
            raise InvalidInputError(f"has the name of another law, {_place(self.laws[name])}")
        if getattr(law, "name", None) != name:
            raise InvalidInputError(
                f"has the name {getattr(law, 'name', None)!r} in its class and {name!r} in its "
                "entry point: must be the same"
            )
        if isabstract(law):
            missing = ", ".join(sorted(cast(Any, law).__abstractmethods__))
            raise InvalidInputError(f"does not define {missing}")
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
        "autostart", "wait_for", "use_sim_time",
        *dir(ParameterGroup),
    },
    one_namespace=False,
    trial=try_control_law,
)  # fmt: skip


def add_laws_of_other_packages() -> None:
    """Add the laws of other packages to their families, or the reasons against them."""
    families = FRICTION_LAWS, CONTROLLERS
    found = [
        (entry, package, family)
        for package in distributions()
        # Parsing the entry points takes longer.
        for text in [package.read_text("entry_points.txt") or ""]
        for family in families
        if family.group in text
        for entry in package.entry_points.select(group=family.group)
    ]
    for entry, package, family in sorted(found, key=lambda each: (each[0].name, each[0].value)):
        family.add(entry, package)


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
