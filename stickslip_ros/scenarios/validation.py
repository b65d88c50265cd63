"""Validation of parameters: an error names the parameter, its value and what is allowed."""

from collections.abc import Iterator, Mapping
from enum import StrEnum
from math import inf
from operator import attrgetter
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, PrivateAttr, ValidationError
from pydantic_core import PydanticCustomError

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.curve_file import Pairs
from stickslip_ros.scenarios.parameter_field import LARGEST, SMALLEST, known_parameters
from stickslip_ros.text import by_group, did_you_mean, shown

_KIND_NAMES = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a string",
    list: "a list of strings",
}


_REFUSED = "refused"


def refused(reason: str) -> PydanticCustomError:
    """Return the error for a value that is refused for a reason other than its bounds."""
    return PydanticCustomError(_REFUSED, "{reason}", {"reason": reason})


class ParameterGroup(BaseModel):
    """A group of parameters: those of a node, or a part of them."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True
    )

    _curves: dict[str, Pairs] = PrivateAttr(default_factory=dict[str, Pairs])
    """Pairs in the files of this group, by path."""

    @classmethod
    def validated(
        cls, values: Mapping[str, Any], source: str, curves: Mapping[str, Pairs] | None = None
    ) -> Self:
        """Return the parameters given by flat name, the others at their defaults.

        Files whose `curves` are given by path are not read. Raises InvalidInputError that names
        `source`, parameter, value and what is allowed.
        """
        return cls._validated(values, {}, source, curves)

    def changed(self, values: Mapping[str, Any], source: str) -> Self:
        """Return the parameters with others given by flat name; see `validated`.

        The groups in which nothing changes are not validated again, and only files that are given
        are read.
        """
        names = {name.partition(".")[0] for name in values}
        kept: dict[str, Any] = {}
        given: dict[str, Any] = {}
        for name, each in self:
            if not isinstance(each, ParameterGroup):
                given[name] = each
            elif name in names:
                given |= {f"{name}.{inner}": value for inner, value in each.flat().items()}
            else:
                kept[name] = each
        curves = {path: each for path, each in self.curves().items() if path not in values.values()}
        return self._validated({**given, **values}, kept, source, curves)

    def curves(self) -> dict[str, Pairs]:
        """Return the pairs in the files that these parameters were made from, by path."""
        found = dict(self._curves)
        for _, each in self:
            if isinstance(each, ParameterGroup):
                found |= each.curves()
        return found

    @classmethod
    def _validated(
        cls,
        values: Mapping[str, Any],
        kept: Mapping[str, Any],
        source: str,
        curves: Mapping[str, Pairs] | None = None,
    ) -> Self:
        known = known_parameters(cls)
        for name, value in values.items():
            if name not in known:
                raise InvalidInputError(
                    f"{source}: unknown parameter {name:.80} = {shown(value)}; "
                    f"{did_you_mean(name, known, f'known are {by_group(known)}')}"
                )
        try:
            return cls.model_validate({**kept, **_nested(values)}, context=dict(curves or {}))
        except ValidationError as error:
            raise InvalidInputError(f"{source}: {_explain(cls, error, values)}") from None

    @classmethod
    def check_bounds(cls, name: str, value: Any) -> None:
        """Refuse a value that is out of its own bounds; other parameters do not matter.

        Raises InvalidInputError that names parameter, value and what is allowed.
        """
        if name not in known_parameters(cls):
            raise InvalidInputError(f"unknown parameter {name:.80}")
        try:
            cls.model_validate(_nested({name: value}))
        except ValidationError as error:
            place = tuple(name.split("."))
            if any(detail["loc"][: len(place)] == place for detail in error.errors()):
                raise InvalidInputError(_explain(cls, error, {name: value})) from None

    def flat(self) -> dict[str, Any]:
        """Return the values by flat name, as plain Python types."""
        values = ((name, attrgetter(name)(self)) for name in known_parameters(type(self)))
        return {name: str(value) if isinstance(value, StrEnum) else value for name, value in values}

    def unused(self) -> dict[str, str]:
        """Return why parameters have no effect, by flat name, of those not at their defaults."""
        values, known = self.flat(), known_parameters(type(self))
        return {
            name: f"{name} is not used {why}"
            for name, why in self.not_used()
            if [values[name]] != [known[name].default]  # of lists, a nan equals itself
        }

    def not_used(self) -> Iterator[tuple[str, str]]:
        """Yield the parameters that have no effect beside the others, each with the reason."""
        for group, each in self:
            if isinstance(each, ParameterGroup):
                yield from ((f"{group}.{name}", why) for name, why in each.not_used())


def _explain(model: type[BaseModel], error: ValidationError, values: Mapping[str, Any]) -> str:
    """Return one line on the values that are refused and what is allowed."""
    known = known_parameters(model)
    complaints: list[str] = []
    for detail in error.errors():
        place = [part for part in detail["loc"] if isinstance(part, str)]
        name = ".".join(place)
        if name not in known:
            complaints.append(detail["msg"].removeprefix("Value error, "))
            continue
        if detail["type"] == _REFUSED:
            complaints.append(f"{name} = {shown(detail['input'])} is refused: {detail['msg']}")
            continue
        parameter = known[name]
        allowed = _KIND_NAMES[parameter.kind]
        if parameter.kind is float and parameter.finite:
            allowed = "a finite number"
        value = values.get(name, detail["input"])
        number = isinstance(value, int | float) and not isinstance(value, bool)
        extreme = number and (LARGEST < abs(value) < inf or 0 < value < SMALLEST)
        bounds = parameter.limits if extreme else parameter.bounds
        if bounds:
            allowed = bounds if parameter.choices else f"{allowed} {bounds}"
        unit = f"{'' if bounds else ' in'} {parameter.unit}" if parameter.unit else ""
        if parameter.unset:
            unit += f", or nan ({parameter.unset})"
        text = ", not text" if isinstance(value, str) and parameter.kind is not str else ""
        complaints.append(f"{name} = {shown(value)} is refused: must be {allowed}{unit}{text}")
    return "; ".join(complaints)


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for name, value in values.items():
        *groups, last = name.split(".")
        group = nested
        for each in groups:
            group = group.setdefault(each, {})
        group[last] = value
    return nested
