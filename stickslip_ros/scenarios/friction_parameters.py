"""The parameters of the friction of the plant: its law and the constants of each law."""

import re
from collections.abc import Iterator
from dataclasses import replace
from math import isnan, nan
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    PrivateAttr,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    create_model,
    field_validator,
    model_validator,
)

from stickslip_ros.physics.model.constants import Constant, constants_of
from stickslip_ros.physics.model.friction import (
    LAWS,
    CurveFollower,
    Directional,
    FrictionLaw,
    Table,
)
from stickslip_ros.scenarios.curve_file import Pairs, read_curve
from stickslip_ros.scenarios.foreign_laws import FRICTION_LAWS, add_laws_of_other_packages
from stickslip_ros.scenarios.parameter_field import Fixed, field, field_of, known_parameters
from stickslip_ros.scenarios.validation import ParameterGroup, refused
from stickslip_ros.text import shown

_AS_FORWARD = nan
"""Value of a constant of backward slip that is the one of forward slip."""


def _known_curve(name: str) -> str:
    if name in _known_curves():
        return name
    if _known_law(name):
        raise refused(f"law {name} has a memory: a curve must be a static law")
    return name


def _known_curves() -> list[str]:
    """Return the names of the laws that a law with a memory can follow."""
    return [
        name for name, law in LAWS.items() if not law.states and not issubclass(law, CurveFollower)
    ]


def _known_law(name: str) -> str:
    if name in LAWS:
        return name
    if name in FRICTION_LAWS.refused:
        raise refused(FRICTION_LAWS.refused[name])
    raise ValueError(f"no law {name}")


def _constants_of_laws(*, reverse: bool = False) -> dict[str, Any]:
    """Return a field for each constant of the laws that is one number, by name."""
    described = _reverse_field_of if reverse else field_of
    laws: dict[str, list[str]] = {}
    constants: dict[str, Constant] = {}
    for law in LAWS.values():
        for name, constant in constants_of(law).items():
            if isinstance(constant.default, tuple):
                continue
            if reverse and (constant.whole or name in law.direction_independent):
                continue
            constants.setdefault(name, constant)
            laws.setdefault(name, []).append(law.name)
    return {
        name: described(constant, [] if name in constants_of(FrictionLaw) else laws[name])
        for name, constant in constants.items()
    }


def _reverse_field_of(constant: Constant, laws: list[str]) -> Any:
    """Return type and description of the parameter for a constant of backward slip."""
    meaning = f"{constant.meaning.removesuffix('.')}, for v_r < 0."
    return field_of(replace(constant, default=_AS_FORWARD, meaning=meaning), laws)


def _curve(direction: str = "") -> Any:
    return field(
        "",
        f"CSV file of relative speeds (m/s, from 0 on) and coefficients{direction} (table).",
        fixed=Fixed.RUNNING,
        file=True,
    )


add_laws_of_other_packages()


class ReverseFriction(
    create_model("_Reverse", __base__=ParameterGroup, **_constants_of_laws(reverse=True))
):
    """Coefficients of backward slip, v_r < 0, where they differ from those of forward slip."""

    file: str = _curve(" for v_r < 0; empty: as forward")

    @field_validator("*", mode="wrap")
    @classmethod
    def _as_forward(cls, value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        """Take nan, which no bounds allow, as one object: groups of parameters then compare."""
        return _AS_FORWARD if isinstance(value, float) and isnan(value) else handler(value)

    def __setstate__(self, state: dict[Any, Any]) -> None:
        super().__setstate__(state)
        values = self.__dict__
        values |= {name: _AS_FORWARD for name, value in values.items() if value != value}


class _ChosenLaw(ParameterGroup):
    law: Annotated[str, AfterValidator(_known_law)] = field(
        "stribeck", "Friction law.", choices=LAWS
    )
    curve: Annotated[str, AfterValidator(_known_curve)] = field(
        "exponential",
        "Static law that a law with a memory has in steady slip "
        f"({', '.join(name for name, law in LAWS.items() if issubclass(law, CurveFollower))}).",
        choices=_known_curves(),
    )


class Friction(create_model("_Constants", __base__=_ChosenLaw, **_constants_of_laws())):
    """Friction law and its coefficients; each law uses those of its formula."""

    file: str = _curve()
    reverse: ReverseFriction = ReverseFriction()

    _law: FrictionLaw = PrivateAttr()

    @model_validator(mode="after")
    def _constants_fit_together(self, info: ValidationInfo) -> Self:
        """Refuse constants that the law refuses, under their names as parameters."""
        for kind in self._kinds():
            if issubclass(kind, Table) and not self.file:
                raise ValueError(
                    f"friction.file = {shown(self.file)} is refused: must be the path of a CSV "
                    f"file for law {kind.name}"
                )
        forward = self._constants(self, "friction", info.context)
        reverse = self._constants(self.reverse, "friction.reverse", info.context)

        def make() -> FrictionLaw:
            law = self._made(dict(forward))
            return Directional(law, self._made(reverse, law)) if reverse else law

        try:
            self._law = FRICTION_LAWS.made(make, *self._kinds())
        except ValueError as refusal:

            def parameter(match: re.Match[str]) -> str:
                own = "reverse." if match[1] and match[2] in reverse else ""
                return f"friction.{own}{match[2]} = "

            names = "|".join(name for kind in self._kinds() for name in kind.constants())
            text = re.sub(rf"\b(reverse\.)?({names}) = ", parameter, str(refusal))
            raise ValueError(text) from None
        return self

    def as_law(self) -> FrictionLaw:
        """Return the friction law in SI units."""
        return self._law

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
        own = [name for name in self._parameters() if name not in simple]
        return [*own, *(f"reverse.{name}" for name in self._given(self.reverse))]

    def not_used(self) -> Iterator[tuple[str, str]]:
        """Yield the parameters that the law does not use; see `ParameterGroup.not_used`."""
        law = " with the curve ".join(kind.name for kind in self._kinds())
        used = ("law", *self._parameters())
        for name in known_parameters(type(self)):
            own = name.removeprefix("reverse.")
            if own not in used:
                users = ", ".join(
                    kind.name for kind in LAWS.values() if own in law_parameters(kind)
                )
                yield name, f"by the law {law}; laws that use it: {users}"

    def _kinds(self) -> list[type[FrictionLaw]]:
        """Return the law, and the one that it follows if it follows one."""
        law = LAWS[self.law]
        return [law, LAWS[self.curve]] if issubclass(law, CurveFollower) else [law]

    def _parameters(self) -> list[str]:
        return [name for law in self._kinds() for name in law_parameters(law)]

    def _made(self, values: dict[str, Any], law: FrictionLaw | None = None) -> FrictionLaw:
        """Return the law with these constants, and others at their defaults or as in a `law`."""
        kind, *curves = self._kinds()
        values.pop("curve", None)
        if curves:
            (curve,) = curves
            of_curve = {name: values.pop(name) for name in curve.constants() if name in values}
            known = law.curve if isinstance(law, CurveFollower) else curve()
            values["curve"] = replace(known, **of_curve)
        return kind(**values) if law is None else replace(law, **values)

    def _given(self, group: "Friction | ReverseFriction") -> dict[str, Any]:
        """Return the values of a group for the parameters of the law, by name."""
        known = type(group).model_fields
        values = {name: getattr(group, name) for name in self._parameters() if name in known}
        return {name: value for name, value in values.items() if value not in ("", _AS_FORWARD)}

    def _constants(
        self,
        group: "Friction | ReverseFriction",
        prefix: str,
        curves: dict[str, Pairs] | None,
    ) -> dict[str, Any]:
        """Return the constants of the law that a group gives, those of a table from its file."""
        values = self._given(group)
        if "file" in values:
            path = values.pop("file")
            values["points"] = read_curve(f"{prefix}.file", path, _refusal, curves)
            self._curves[path] = values["points"]
        return values


def law_parameters(law: type[FrictionLaw]) -> list[str]:
    """Return the names of the parameters of a friction law, in the group `friction`."""
    if issubclass(law, Table):
        return ["file"]
    return [name for name in law.constants() if name in Friction.model_fields]


def _refusal(points: Pairs) -> str | None:
    return Table(points).refusal()
