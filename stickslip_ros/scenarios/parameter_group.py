"""Groups of parameters: checked, changed, and given by flat name; and the group of every node."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any, Self

from typing_extensions import override

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Parameter, at_build, at_rest, constant, parameters_of
from stickslip_ros.scenarios.curve_file import Pairs
from stickslip_ros.scenarios.refusals import checked
from stickslip_ros.text import by_group, did_you_mean, shown

SHORTEST_TIME = 1e-3
"""Shortest time-out or period of a node, s."""
_NAME = "[A-Za-z_][A-Za-z0-9_]*"
_NODE_NAME = re.compile(f"/?({_NAME}/)*{_NAME}")


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


@dataclass(frozen=True)
class NodeParameters(ParameterGroup):
    """Parameters that every node has."""

    autostart: bool = at_rest(True, "Configure and activate the node at start.")
    wait_for: list[str] = at_rest(
        [], "Nodes that must subscribe to this node's topics before it activates."
    )
    use_sim_time: bool = constant(False, "Take ROS time from /clock.")
    thread_priority: int = at_rest(
        0,
        "Priority (SCHED_FIFO) of the threads of the node's process; 0: ordinary scheduling.",
        whole=True,
        at_least=0,
        at_most=99,
    )
    cpu_affinity: int = at_rest(
        -1,
        "Processor on which the node's process runs; -1: any.",
        whole=True,
        at_least=-1,
        at_most=4095,
    )
    lock_memory: bool = at_rest(
        False, "Keep the memory of the node's process from being paged out."
    )

    @override
    def completed(self, prefix: str, curves: dict[str, Pairs]) -> Self:
        if not all(_NODE_NAME.fullmatch(name) for name in self.wait_for):
            raise ValueError(
                f"wait_for = {shown(self.wait_for)} is invalid: must be names of nodes, "
                "of letters, digits and _, not starting with a digit"
            )
        return self


def numbered_force() -> Any:
    """Return the field of the number of the force in the messages of a controller."""
    return at_build(
        0,
        "Number of the force in the arrays on `control_force`, from 1; 0: they have only one.",
        whole=True,
        at_least=0,
        at_most=1000,
    )
