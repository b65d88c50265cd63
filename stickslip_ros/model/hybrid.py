"""Hybrid systems: states that follow the rates of a mode, and guards that lead to another mode.

One description serves the integrator, the equilibrium, the derivatives of any order, the
variational equations and the jumps of the derivatives at a guard.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import heyoka as hy

_Shared = TypeVar("_Shared")


@dataclass(frozen=True, slots=True)
class Mode:
    """Mode of a hybrid system: a flow, and values that are constant in the mode.

    A system of several parts has a mode of each part in `switches`, one after another: the modes of
    the system are products of the modes of its parts, and those of one flow are compiled once.
    """

    flow: str
    """Name of the flow."""
    switches: tuple[float, ...]
    """Values of the system's switches."""


@dataclass(slots=True)
class Instant:
    """Instant of a motion, dimensionless."""

    state: "memoryview[float]"
    """Values of the states, mostly a view of the integrator in which they lie."""
    inputs: list[float]
    """Values of the inputs."""
    time: float = 0.0
    """Time from the start of the motion."""


Transition = Callable[[Any, Mode, Instant], Mode | None]
"""Method of a system: the mode that follows, or None at the end of the motion.

It may set the state. It is not bound to a system, since those of one structure share their flows.
"""


@dataclass(frozen=True)
class Guard:
    """Ends a mode where its margin falls to zero, and leads to the mode that follows."""

    margin: Any
    """Expression that is above zero in the mode."""
    transition: Transition


@dataclass(frozen=True)
class Flow:
    """Right-hand side of the modes of one kind, as expressions."""

    rates: tuple[Any, ...]
    """Derivative of each state by time."""
    guards: tuple[Guard, ...]
    marks: tuple[Any, ...] = ()
    """Expressions at whose zeros a recorded motion has breakpoints."""
    step_limiters: tuple[Any, ...] = ()
    """Expressions above zero whose series the steps of the integration resolve, too."""

    @cached_property
    def transitions(self) -> tuple[Transition, ...]:
        """Where each guard leads."""
        return tuple(guard.transition for guard in self.guards)


class Symbols(NamedTuple):
    """The variables of a system, as expressions."""

    state: tuple[Any, ...]
    constants: Mapping[str, Any]
    inputs: tuple[Any, ...]
    switches: tuple[Any, ...]
    time: Any
    """Time from the start of the motion."""


class HybridSystem(ABC):
    """Hybrid system with the values of its constants; all values are dimensionless.

    Systems of equal `structure` have the same flows, as expressions, and differ in the values of
    their constants.
    """

    structure: int
    """Number of the structure; see `structure_number`."""
    states: tuple[str, ...]
    """Names of the states."""
    free_constants: tuple[str, ...] = ()
    """Names of the constants by which a motion may have derivatives."""
    inputs: tuple[str, ...]
    """Names of values that are set from outside and held."""
    switches: tuple[str, ...]
    """Names of values that are constant in each mode."""
    constants: dict[str, float]
    """The constants by name, in an order that the structure gives; a motion may set one."""

    @abstractmethod
    def flow(self, name: str) -> Flow:
        """Return a flow by its name, in `symbols`."""

    def shared(self, key: Hashable, make: Callable[[], _Shared]) -> _Shared:
        """Return what all systems of this structure share under a key; it is made once."""
        by_key = _shared.setdefault(self.structure, {})
        if key not in by_key:
            by_key[key] = make()
        return by_key[key]

    def shared_flow(self, name: str) -> Flow:
        """Return a flow by its name; systems of one structure share it."""
        return self.shared(("flow", name), lambda: self.flow(name))

    closed_flow: str | None = None
    """Name of the flow whose modes `closed_form` solves; None without one."""

    def closed_form(
        self, mode: Mode, instant: Instant, duration: float
    ) -> tuple[int | None, float]:
        """Advance the state for `duration` or up to a guard; return the guard and the time."""
        raise NotImplementedError

    many_steps = False
    """Whether an integration takes many steps, which must not depend on what is recorded."""

    @cached_property
    def variables(self) -> tuple[Any, ...]:
        """The states as variables of expressions."""
        return tuple(hy.expression(name) for name in self.states)

    @property
    def index(self) -> Mapping[str, int]:
        """Index of constants, inputs, switches and of the time at the start, by name."""
        names = (*self.constants, *self.inputs, *self.switches, "epoch")
        return self.shared("index", lambda: {name: n for n, name in enumerate(names)})

    @cached_property
    def symbols(self) -> Symbols:
        """The variables of the expressions of `flow`."""
        par = {name: hy.par[number] for name, number in self.index.items()}
        return Symbols(
            self.variables,
            {name: par[name] for name in self.constants},
            tuple(par[name] for name in self.inputs),
            tuple(par[name] for name in self.switches),
            par["epoch"] + hy.time,
        )


_shared: dict[int, dict[Hashable, Any]] = {}
_structures: dict[Hashable, int] = {}


def structure_number(structure: Hashable) -> int:
    """Return the number of a structure, the same for equal ones: it is quicker to look up."""
    return _structures.setdefault(structure, len(_structures))


def with_switches(mode: Mode, first: int, values: Sequence[float]) -> Mode:
    """Return a mode with other switches from the index `first` on."""
    switches = mode.switches
    return Mode(mode.flow, (*switches[:first], *values, *switches[first + len(values) :]))
