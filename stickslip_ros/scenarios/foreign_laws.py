"""The laws of other installed packages, found by their entry points and checked when they are used.

Their classes are imported to describe their constants, which are parameters. One that cannot be
imported, or would be in the way of other laws, is refused where it is named.
"""

import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from math import isfinite, isinf
from operator import attrgetter
from traceback import walk_tb
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from stickslip_ros.errors import InvalidInputError, in_words
from stickslip_ros.model.constants import Parameter, constants_of
from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.model.control.base import seen_by
from stickslip_ros.model.friction import LAWS, Directional, FrictionLaw
from stickslip_ros.scenarios.parameter_group import ParameterGroup
from stickslip_ros.scenarios.refusals import checked

if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

_Law = TypeVar("_Law", bound=FrictionLaw | ControlLaw)
_Base = TypeVar("_Base")

_fixed = attrgetter("unit", "default", "at_least", "at_most", "below", "positive")
"""Returns what must be the same for all constants of one name."""


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
    check: Callable[[Any], None]
    """Asks a law once what motion and theory will ask of it; raises anything."""
    refused: dict[str, str] = field(default_factory=dict[str, str])
    """Reason of the refusal of each law of another package that is refused, by name."""

    def add(self, entry: "EntryPoint", package: "Distribution") -> None:
        """Add the law of an entry point, or the reason against it to `refused`."""
        try:
            law = loaded(entry, self.base)
            if self.laws.get(entry.name) is not law:  # the package can be on the path twice
                self._accept(entry.name, law)
                law.package = package.name
                self.laws[entry.name] = law
        except InvalidInputError as error:
            reason = f"{entry.value} of package {package.name} {error}"
            known = self.refused.get(entry.name)
            self.refused[entry.name] = f"{known}; {reason}" if known and known != reason else reason

    def _accept(self, name: str, law: type[_Law]) -> None:
        """Refuse a law that would be in the way of others by its name or its constants."""
        if not (name.isascii() and name.isidentifier()):
            raise InvalidInputError(f"has the name {name!r}: must be of letters, digits and _")
        if name in self.laws:
            raise InvalidInputError(
                f"has the name of another law, {self.laws[name].__module__}."
                f"{self.laws[name].__qualname__}"
            )
        check_name(name, law)
        for constant in constants_of(law).values():
            self._accept_constant(constant)
        made(law)

    def _accept_constant(self, constant: Parameter) -> None:
        name, is_tuple = constant.name, isinstance(constant.default, tuple)
        if name in self.reserved:
            raise InvalidInputError(
                f"has a constant {name}: the name cannot be that of a parameter"
            )
        for law in self.laws.values() if self.one_namespace else ():
            known = constants_of(law).get(name)
            both_tuples = is_tuple and known is not None and isinstance(known.default, tuple)
            if known is not None and not both_tuples and _fixed(known) != _fixed(constant):
                raise InvalidInputError(
                    f"has a constant {name} unlike that of law {law.name}: must have its unit "
                    f"({known.unit or 'none'}), default ({known.default}) and bounds, or another "
                    "name"
                )
        try:
            if not is_tuple:
                checked(constant, constant.default)
        except InvalidInputError as error:
            raise InvalidInputError(f"has a wrong default: {error}") from None

    def made(self, make: Callable[[], _Law], *kinds: type[_Law]) -> _Law:
        """Return a law of these classes with its constants; those of other packages are checked.

        Raises ValueError with the reason if the constants do not fit together, or the law fails.
        """
        foreign = next((kind for kind in kinds if kind.package), None)
        try:
            law = make()
            refusal = law.refusal()
            if foreign and refusal is None:
                self.check(law)
        except (Exception, SystemExit) as error:
            if foreign is None:
                raise
            raise ValueError(
                f"law {foreign.name} of package {foreign.package} fails: {in_words(error)}"
            ) from None
        if refusal is not None:
            raise ValueError(refusal)
        return law


def check_friction_law(law: FrictionLaw) -> None:
    """Ask a friction law for its equations, as numbers at one speed and as symbols."""
    import heyoka as hy  # only where a package has a law

    from stickslip_ros.motion.compilation import compiled_function

    for way in (law.forward, law.reverse) if isinstance(law, Directional) else (law,):

        def equations(*given: Any, law: FrictionLaw = way) -> list[Any]:
            rates = law.memory_rates(*given)
            return [law.friction(*given), *rates, *law.margins(*given)]

        speed = way.characteristic_speed
        unit = 1.0 if isinf(speed) else float(speed)
        for sign in (1.0, -1.0):
            memory = way.memory_at(sign * unit, sign)
            switches = way.switches_at(sign * unit, sign, memory)
            _check_finite("friction", equations(sign * unit, sign, memory, switches))
        symbols = [hy.expression(name) for name in ("speed", "sign", *way.states, *way.switches)]
        count = 2 + len(way.states)
        symbolic = equations(*symbols[:2], symbols[2:count], symbols[count:])
        compiled_function([hy.expression(0.0) + equation for equation in symbolic], symbols)
        _check_finite("limits", way.limits)


def check_control_law(law: ControlLaw) -> None:
    """Ask a control law for its equations, if it has some; its answers are checked as they come."""
    linear = law.linear_feedback(1e-3)
    if linear is not None:
        _check_finite("linear_feedback", np.concatenate([np.ravel(matrix) for matrix in linear]))
    control = law.continuous
    if control is not None:
        seen = seen_by(control, 0.1, 0.2, ())
        states = control.rest(*seen)
        rates = control.state_rates(*seen, states)
        _check_finite("continuous form", [*rates, control.control_force(*seen, states)])


def _check_finite(name: str, values: Iterable[Any]) -> None:
    numbers = [float(value) for value in values]
    if not all(map(isfinite, numbers)):
        raise InvalidInputError(f"its {name} is {numbers}, which must be finite numbers")


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
    check=check_friction_law,
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
    check=check_control_law,
)  # fmt: skip


ADAPTERS = "stickslip_ros.identified_laws"
"""Entry point group in which other packages name the adapters of identification of their laws."""
GROUPS = FRICTION_LAWS.group, CONTROLLERS.group, ADAPTERS


def add_laws_of_other_packages() -> None:
    """Add the laws of other packages to their families, or the reasons against them."""
    families = {family.group: family for family in (FRICTION_LAWS, CONTROLLERS)}
    for entry, package in entries_of_other_packages(*families):
        families[entry.group].add(entry, package)


def entries_of_other_packages(*groups: str) -> "list[tuple[EntryPoint, Distribution]]":
    """Return the entry points of groups with their packages, by name."""
    entries = [
        (entry, package)
        for package in _packages_that_name(groups)
        for group in groups
        for entry in package.entry_points.select(group=group)
    ]
    return sorted(entries, key=lambda pair: (pair[0].name, pair[0].value))


def _packages_that_name(groups: Iterable[str]) -> "Iterator[Distribution]":
    """Yield the packages on the path whose entry points name one of the groups.

    Mostly there is none: to load importlib.metadata and to ask that takes ten times as long.
    """
    sought = [group.encode() for group in groups]
    for folder in sys.path:
        for name in _names_in(folder or "."):
            if name.endswith((".dist-info", ".egg-info", "EGG-INFO")):
                about = os.path.join(folder, name)
                text = _content(os.path.join(about, "entry_points.txt"))
                if any(group in text for group in sought):
                    from importlib.metadata import Distribution

                    yield Distribution.at(about)


def _names_in(folder: str) -> list[str]:
    try:
        return os.listdir(folder)
    except OSError:  # such as a zip file on the path
        return []


def _content(path: str) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError:  # most packages have none
        return b""


def failure_in_words(error: BaseException) -> str | None:
    """Return an error that the code of another package's law has raised; None for any other."""
    modules = {frame.f_globals.get("__name__") for frame, _ in walk_tb(error.__traceback__)}
    for entry, package in entries_of_other_packages(*GROUPS):
        if entry.module in modules:
            return f"law {entry.name} of package {package.name} fails: {in_words(error)}"
    return None


def loaded(entry: "EntryPoint", base: type[_Base]) -> type[_Base]:
    """Return the class of an entry point; InvalidInputError if none derives from `base`."""
    try:
        kind = entry.load()
    except (Exception, SystemExit) as error:  # the code of others: anything
        raise InvalidInputError(f"cannot be imported: {in_words(error)}") from None
    if not (isinstance(kind, type) and issubclass(kind, base)):
        raise InvalidInputError(f"is no class derived from {base.__name__}")
    return kind


def made(kind: type[_Base]) -> _Base:
    """Return an object of a class of another package, by default values."""
    try:
        return kind()
    except (Exception, SystemExit) as error:
        raise InvalidInputError(f"fails with its defaults: {in_words(error)}") from None


def check_name(name: str, kind: type) -> None:
    """Refuse a class that has another name than its entry point."""
    named = getattr(kind, "name", None)
    if named != name:
        raise InvalidInputError(
            f"has the name {named!r} in its class and {name!r} in its entry point: must be the same"
        )
