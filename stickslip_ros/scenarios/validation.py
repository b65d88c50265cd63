"""Groups of parameters: checked, changed, and given by flat name."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from functools import cache
from math import inf, isfinite, isnan
from operator import attrgetter
from pathlib import Path
from typing import Any, Self

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import LARGEST, SMALLEST, Parameter, parameters_of
from stickslip_ros.scenarios.curve_file import Pairs
from stickslip_ros.text import by_group, did_you_mean, shown

_KIND_NAMES = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a string",
    list: "a list of strings",
}


@dataclass(frozen=True)
class ParameterGroup:
    """A group of parameters: those of a node, or a part of them.

    It is made of its defaults, and changed by `changed`, which checks every value.
    """

    @property
    def known(self) -> Mapping[str, Parameter]:
        """The parameters by flat name, in order of definition."""
        return _known(type(self))

    def changed(
        self, values: Mapping[str, Any], source: str, curves: Mapping[str, Pairs] | None = None
    ) -> Self:
        """Return the parameters with others given by flat name.

        Only files that are given are read, and of these only files whose `curves` are not given by
        path. Raises InvalidInputError that names `source`, parameter, value and what is allowed.
        """
        known = self.known
        complaints: list[str] = []
        taken: dict[str, Any] = {}
        for name in filter(values.__contains__, known):
            try:
                taken[name] = checked(known[name], values[name])
            except InvalidInputError as error:
                complaints.append(str(error))
        for name, value in values.items():
            if name not in known and not complaints:  # it may be of a choice that is refused
                raise InvalidInputError(
                    f"{source}: unknown parameter {name:.80} = {shown(value)}; "
                    f"{did_you_mean(name, known, f'known are {by_group(known)}')}"
                )
        if not complaints:
            reads = "file" in known or any("." in name for name in taken)
            curves_now = self.curves() if reads else {}
            kept = {path: pairs for path, pairs in curves_now.items() if path not in taken.values()}
            changed = _changed(self, taken, "", {**kept, **(curves or {})}, complaints)
            if not complaints:
                return changed
        raise InvalidInputError(f"{source}: {'; '.join(complaints)}")

    def check_bounds(self, name: str, value: Any) -> None:
        """Refuse a value that is out of its own bounds; other parameters do not matter.

        Raises InvalidInputError that names parameter, value and what is allowed.
        """
        if name not in self.known:
            raise InvalidInputError(f"unknown parameter {name:.80}")
        checked(self.known[name], value)

    def absolute(self, name: str, value: Any, folder: Path = Path()) -> Any:
        """Return a value; a path that is relative to a folder as an absolute one."""
        is_path = name in self.known and self.known[name].file and value and isinstance(value, str)
        return str((folder / value).absolute()) if is_path else value

    def replaced(self, values: Mapping[str, Any]) -> Self:
        """Return the group with other values of its own fields, by name."""
        made, present = object.__new__(type(self)), vars(self)  # `replace` takes five times as long
        vars(made).update({name: present[name] for name in self.__dataclass_fields__}, **values)
        return made

    def completed(self, prefix: str, curves: dict[str, Pairs]) -> Self:
        """Return the group with what is in its files; those whose `curves` are known are not read.

        Raises ValueError, with a sentence, if its values do not fit together. `prefix` is what its
        parameters have before their names.
        """
        return self

    def curves(self) -> dict[str, Pairs]:
        """Return the pairs in the files that these parameters were made from, by path."""
        given: Any = self
        curves = {given.file: given.points} if getattr(self, "points", ()) else {}
        for group in vars(self).values():
            if isinstance(group, ParameterGroup):
                curves |= group.curves()
        return curves

    def flat(self) -> dict[str, Any]:
        """Return the values by flat name, as plain Python types."""
        values = ((name, attrgetter(name)(self)) for name in self.known)
        return {name: str(value) if isinstance(value, StrEnum) else value for name, value in values}

    def unused(self) -> dict[str, str]:
        """Return why parameters have no effect, by flat name, of those not at their defaults."""
        values, known = self.flat(), self.known
        return {
            name: f"{name} is not used {why}"
            for name, why in self.not_used()
            if not known[name].is_default(values[name])
        }

    def not_used(self) -> Iterator[tuple[str, str]]:
        """Yield the parameters that have no effect beside the others, each with the reason."""
        for part in fields(self):
            group = getattr(self, part.name)
            if isinstance(group, ParameterGroup):
                yield from ((f"{part.name}.{name}", why) for name, why in group.not_used())


@cache
def _known(kind: type) -> Mapping[str, Parameter]:
    return {parameter.name: parameter for parameter in parameters_of(kind())}


def _changed(
    part: Any,
    values: Mapping[str, Any],
    prefix: str,
    curves: dict[str, Pairs],
    complaints: list[str],
) -> Any:
    """Return a group, or a part of a drive, with other values; reasons against it are added."""
    changes: dict[str, Any] = {}
    inner: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        group, dot, rest = name.partition(".")
        if dot:
            inner.setdefault(group, {})[rest] = value
        else:
            changes[group] = value
    for group, given in inner.items():
        changes[group] = _changed(
            getattr(part, group), given, f"{prefix}{group}.", curves, complaints
        )
    if complaints and not prefix:
        return part
    try:
        if isinstance(part, ParameterGroup):
            return part.replaced(changes).completed(prefix, curves)
        changed = replace(part, **changes)
        refusal = changed.refusal() if hasattr(changed, "refusal") else None
        if refusal is not None:
            complaints.append(f"{prefix}{refusal}")
        return changed
    except ValueError as error:
        complaints.append(str(error))
        return part


def checked(parameter: Parameter, value: Any) -> Any:
    """Return the value of a parameter, as its type.

    Raises InvalidInputError that names parameter, value and what is allowed.
    """
    kind = parameter.kind
    if parameter.choices:
        if isinstance(value, str) and value in parameter.choices:
            return parameter.choices[parameter.choices.index(value)]
    elif kind is float:
        if isinstance(value, int | float) and not isinstance(value, bool):
            with suppress(OverflowError):
                number = float(value)
                if parameter.unset and isnan(number):
                    return parameter.default
                if _within(parameter, number):
                    return number
    elif kind is int:
        if isinstance(value, int) and not isinstance(value, bool) and _within(parameter, value):
            return value
    elif kind is list:
        if isinstance(value, list) and all(isinstance(item, str) for item in value):
            return [*value]
    elif isinstance(value, kind):
        return value
    raise InvalidInputError(_refusal(parameter, value))


def _within(parameter: Parameter, number: float) -> bool:
    least, largest = parameter.least, parameter.largest
    return (
        (isfinite(number) or not (parameter.finite or isnan(number)))
        and (least is None or number >= least)
        and (largest is None or number <= largest)
    )


def _refusal(parameter: Parameter, value: Any) -> str:
    """Return one line on a value that is refused and what is allowed."""
    refused = f"{parameter.name} = {shown(value)} is invalid: "
    if isinstance(value, str) and value in parameter.refused:
        return refused + parameter.refused[value]
    kind = parameter.kind
    allowed = "a finite number" if kind is float and parameter.finite else _KIND_NAMES[kind]
    extreme = isinstance(value, int | float) and (
        LARGEST < abs(value) < inf or 0 < value < SMALLEST
    )
    bounds = parameter.limits if extreme else parameter.bounds
    if bounds:
        allowed = bounds if parameter.choices else f"{allowed} {bounds}"
    unit = f"{'' if bounds else ' in'} {parameter.unit}" if parameter.unit else ""
    if parameter.unset:
        unit += f", or nan ({parameter.unset})"
    text = ", not text" if isinstance(value, str) and kind is not str else ""
    return f"{refused}must be {allowed}{unit}{text}"
