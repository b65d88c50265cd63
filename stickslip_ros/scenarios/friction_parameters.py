"""The parameters of the friction of the plant: its law and the constants of each law.

They are those of the laws of this package and of the other packages that are installed.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, make_dataclass, replace
from functools import cached_property
from math import nan
from typing import Any, Self

from typing_extensions import override

from stickslip_ros.model.constants import Changes, Parameter, constant, constants_of, described_by
from stickslip_ros.model.friction import (
    WITHDRAWN,
    CurveFollower,
    Directional,
    FrictionLaw,
    Stiction,
    Table,
)
from stickslip_ros.scenarios.curve_file import Pairs, read_curve
from stickslip_ros.scenarios.foreign_laws import FRICTION_LAWS, add_laws_of_other_packages
from stickslip_ros.scenarios.parameter_group import ParameterGroup
from stickslip_ros.text import renamed, shown

add_laws_of_other_packages()
LAWS = FRICTION_LAWS.laws
_FOLLOWERS = [name for name, law in LAWS.items() if issubclass(law, CurveFollower)]
_CURVES = [name for name, law in LAWS.items() if not law.states and law is not Stiction]
"""The laws that a law with a memory can follow."""


def _constants(*, reverse: bool) -> type[ParameterGroup]:
    """Return a group with the constants of all laws that are one number, of one direction.

    Its fields are made here: what laws there are is known only now.
    """
    users: dict[str, list[str]] = {}
    constants: dict[str, Parameter] = {}
    for law in LAWS.values():
        for name, described in constants_of(law).items():
            directed = not (described.whole or name in law.direction_independent)
            if not isinstance(described.default, tuple) and (directed or not reverse):
                constants.setdefault(name, described)
                users.setdefault(name, []).append(law.name)
    fields: list[tuple[str, Any, Any]] = []
    for name, described in constants.items():
        meaning = described.meaning.removesuffix(".") + (", for v_r < 0" if reverse else "")
        if name not in constants_of(FrictionLaw):
            meaning += f" ({', '.join(users[name])})"
        unset: dict[str, Any] = {"default": nan, "unset": "as forward"} if reverse else {}
        fields.append((name, Any, described_by(replace(described, meaning=f"{meaning}.", **unset))))
    return make_dataclass("Constants", fields, bases=(ParameterGroup,), frozen=True)


def _curve(direction: str = "") -> Any:
    return constant(
        "",
        f"CSV file of relative speeds (m/s, from 0 on) and coefficients{direction} (table).",
        changes=Changes.AT_START,
        file=True,
    )


@dataclass(frozen=True)
class ReverseFriction(_constants(reverse=True)):
    """Coefficients of backward slip, v_r < 0, where they differ from those of forward slip."""

    file: str = _curve(" for v_r < 0; empty: as forward")
    points: Pairs = ()
    """Content of the file of a table."""

    @property
    def given(self) -> dict[str, Any]:
        """The coefficients and the file that are not as those of forward slip, by name."""
        values = ((name, getattr(self, name)) for name in self.known)
        return {name: value for name, value in values if not self.known[name].is_default(value)}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ReverseFriction):
            return NotImplemented
        return (self.given, self.points) == (other.given, other.points)

    def __hash__(self) -> int:
        return hash((self.points, *self.given.items()))


@dataclass(frozen=True)
class _ChosenLaw:
    law: str = constant(
        "stribeck", "Friction law.", choices=LAWS, refused=WITHDRAWN | FRICTION_LAWS.refused
    )
    curve: str = constant(
        "exponential",
        f"Static law that a law with a memory has in steady slip ({', '.join(_FOLLOWERS)}).",
        choices=_CURVES,
        refused={
            **{
                name: f"law {name} has {'a memory' if law.states else 'stiction'}: a curve "
                "must be a static law whose friction does not fall where slip starts"
                for name, law in LAWS.items()
                if name not in _CURVES
            },
            **FRICTION_LAWS.refused,
        },
    )


@dataclass(frozen=True)
class Friction(_constants(reverse=False), _ChosenLaw):
    """Friction law and its coefficients; each law uses those of its formula."""

    file: str = _curve()
    reverse: ReverseFriction = field(default_factory=ReverseFriction)
    points: Pairs = ()
    """Content of the file of a table."""

    @override
    def completed(self, prefix: str, curves: dict[str, Pairs]) -> Self:
        in_use = any(issubclass(kind, Table) for kind in self._kinds())
        if in_use and not self.file:
            raise ValueError(
                f"{prefix}file = {shown(self.file)} is invalid: must be the path of a CSV file for "
                f"law {Table.name}"
            )

        def read(group: Any, name: str) -> Any:
            if not (in_use and group.file):
                return replace(group, points=())
            pairs = read_curve(
                f"{prefix}{name}", group.file, lambda points: Table(points).refusal(), curves
            )
            return replace(group, points=pairs)

        completed = replace(read(self, "file"), reverse=read(self.reverse, "reverse.file"))
        _ = completed.selected  # raises ValueError for what does not fit together
        return completed

    @cached_property
    def selected(self) -> FrictionLaw:
        """The friction law with its constants, in SI units.

        Raises ValueError, with the names of the parameters, for constants that the law refuses.
        """
        law, *curves = self._kinds()
        forward = self._given(vars(self), self.points)
        reverse = self._given(self.reverse.given, self.reverse.points)

        def make() -> FrictionLaw:
            made = _changed(law(*(curve() for curve in curves)), forward)
            return Directional(made, _changed(made, reverse)) if reverse else made

        try:
            return FRICTION_LAWS.made(make, law, *curves)
        except ValueError as refusal:
            constants = [name for kind in (law, *curves) for name in kind.constants()]
            parameters = {name: f"friction.{name}" for name in constants}
            for name in constants:
                group = "friction.reverse" if name in reverse else "friction"
                parameters[f"reverse.{name}"] = f"{group}.{name}"
            raise ValueError(renamed(str(refusal), parameters)) from None

    def names(self) -> list[str]:
        """Return the names of the parameters that make the law.

        Constants of backward slip that are not given are none of them, and no constant at a default
        that simplifies the equations.
        """
        simple = {
            name
            for law in self._kinds()
            for name, described in constants_of(law).items()
            if described.simplifies and getattr(self, name) == described.default
        }
        forward = [name for name in self._parameters() if name not in simple]
        reverse = [name for name in self._parameters() if name in self.reverse.given]
        return [*forward, *(f"reverse.{name}" for name in reverse)]

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        law = " with the curve ".join(kind.name for kind in self._kinds())
        used = ("law", *self._parameters())
        for name in self.known:
            forward = name.removeprefix("reverse.")
            if forward not in used:
                users = ", ".join(
                    kind.name for kind in LAWS.values() if forward in law_parameters(kind)
                )
                yield name, f"by the law {law}; laws that use it: {users}"

    def _kinds(self) -> list[type[FrictionLaw]]:
        """Return the law, and the one that it follows if it follows one."""
        law = LAWS[self.law]
        return [law, LAWS[self.curve]] if issubclass(law, CurveFollower) else [law]

    def _parameters(self) -> list[str]:
        return [name for law in self._kinds() for name in law_parameters(law)]

    def _given(self, values: Mapping[str, Any], points: Pairs) -> dict[str, Any]:
        """Return the constants of the law among the values, and of a table its points."""
        names = [n for n in self._parameters() if n in values and n not in ("curve", "file")]
        return {n: values[n] for n in names} | ({"points": points} if points else {})


def _changed(law: FrictionLaw, values: Mapping[str, Any]) -> FrictionLaw:
    """Return a law with other constants, those of the curve that it follows among them."""
    if not isinstance(law, CurveFollower):
        return replace(law, **values)
    curve = {name: values[name] for name in law.curve.constants() if name in values}
    others = {name: value for name, value in values.items() if name not in curve}
    return replace(law, curve=replace(law.curve, **curve), **others)


def law_parameters(law: type[FrictionLaw]) -> list[str]:
    """Return the names of the parameters of a friction law, in the group `friction`."""
    if issubclass(law, Table):
        return ["file"]
    return [name for name in law.constants() if name in Friction.__dataclass_fields__]
