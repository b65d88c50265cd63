"""A control law as a program of assignments and decisions, found by running the law on symbols."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partialmethod
from math import isfinite
from typing import Any, Union

from stickslip_ros.errors import InvalidInputError, in_words
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.samples import MotorSample, Reference, Sample

_MOST_DECISIONS = 12
"""Decisions, one after the other, up to which a law is worth a program."""

Operand = Union["Symbol", float]
"""A number, or what the program computes."""


@dataclass(frozen=True, eq=False)
class Symbol:
    """A value of the program: an input, or an operation on other values.

    It computes like a float; a comparison decides by the path that is being run.
    """

    operation: str
    """Name of the input, state or function, or the operator."""
    operands: tuple[Operand, ...]
    """What is operated on; nothing for an input."""
    explorer: "_Explorer"
    """Runs the law of which the symbol is a part."""

    def _with(self, operation: str, *operands: Operand) -> "Symbol":
        return self.explorer.symbol(operation, *operands)

    def _of_self(self, operation: str, *others: Operand) -> "Symbol":
        return self._with(operation, self, *others)

    def __add__(self, other: Operand) -> Operand:
        if _is(other, 0.0):
            return self
        negative = _negative(other)
        return self._with("+", self, other) if negative is None else self - negative

    def __radd__(self, other: Operand) -> Operand:
        return self if _is(other, 0.0) else self._with("+", other, self)

    def __sub__(self, other: Operand) -> Operand:
        if _is(other, 0.0) or other is self:
            return 0.0 if other is self else self
        negative = _negative(other)
        return self._with("-", self, other) if negative is None else self + negative

    def __rsub__(self, other: Operand) -> Operand:
        return -self if _is(other, 0.0) else self._with("-", other, self)

    def __mul__(self, other: Operand) -> Operand:
        if _is(other, 0.0) or _is(other, 1.0):
            return self if other else 0.0
        return self._with("*", self, other)

    def __rmul__(self, other: float) -> Operand:
        return (self if other else 0.0) if other in (0.0, 1.0) else self._with("*", other, self)

    def __rtruediv__(self, other: Operand) -> Operand:
        return self._with("/", other, self)

    def __pow__(self, exponent: float) -> Operand:
        return self if _is(exponent, 1.0) else self._with("pow", self, exponent)

    __truediv__ = partialmethod(_of_self, "/")
    __neg__ = partialmethod(_of_self, "-")
    __abs__ = partialmethod(_of_self, "fabs")
    exp, expm1 = partialmethod(_of_self, "exp"), partialmethod(_of_self, "expm1")

    def __eq__(self, other: object) -> bool:
        if other is self or not isinstance(other, int | float | Symbol):
            return other is self
        return self._decides("==", other if isinstance(other, Symbol) else float(other))

    __hash__ = object.__hash__

    def __bool__(self) -> bool:
        return not self._decides("==", 0.0)

    def _decides(self, comparison: str, other: Operand) -> bool:
        if not isinstance(other, Symbol) and not isfinite(other):  # without a limit
            return (other > 0.0) == (comparison in ("<", "<="))
        return self.explorer.decide(self._of_self(comparison, other))

    __lt__ = partialmethod(_decides, "<")
    __le__ = partialmethod(_decides, "<=")
    __gt__ = partialmethod(_decides, ">")
    __ge__ = partialmethod(_decides, ">=")


@dataclass(frozen=True, eq=False)
class Decision:
    """What the program does if a comparison holds, and if it does not."""

    condition: Symbol
    """The comparison."""
    holds: "Result | Decision"
    """What follows if it holds."""
    fails: "Result | Decision"
    """What follows if it does not."""

    @property
    def values(self) -> tuple[Operand, ...]:
        """The comparison."""
        return (self.condition,)

    @property
    def key(self) -> tuple[Any, ...]:
        """What equal decisions of a program have in common."""
        return id(self.condition), self.holds.key, self.fails.key

    def all_values(self) -> Iterator[Operand]:
        """Yield the comparison, and those and the results of what follows."""
        yield from (self.condition, *self.holds.all_values(), *self.fails.all_values())


@dataclass(frozen=True, eq=False)
class Result:
    """Force, N, and state after the sample, in the order of the law."""

    force: Operand
    """Force, N."""
    state: tuple[Operand, ...]
    """State after the sample."""

    @property
    def values(self) -> tuple[Operand, ...]:
        """The new state, and then the force."""
        return *self.state, self.force

    @property
    def key(self) -> tuple[Any, ...]:
        """What equal results of a program have in common."""
        return tuple(id(value) if isinstance(value, Symbol) else value for value in self.values)

    def all_values(self) -> Iterator[Operand]:
        """Yield the new state, and then the force."""
        yield from self.values


@dataclass(frozen=True)
class LawProgram:
    """A control law at a fixed rate."""

    states: tuple[str, ...]
    """Names of the states."""
    inputs: tuple[str, ...]
    """Names of the inputs that the law uses."""
    first: Result | Decision
    """What it does at the first sample, from no state."""
    next: Result | Decision
    """What it does at a further sample."""


_CONTRARY = {"<": ">", ">": "<"}

_Run = Callable[[Callable[[str], Symbol]], Result]
"""Runs a law on symbols that the argument makes by name."""


class _Explorer:
    """Runs laws along one way through their decisions after the other; equal symbols are one."""

    def __init__(self) -> None:
        self._symbols: dict[tuple[Any, ...], Symbol] = {}
        self._given: tuple[bool, ...] = ()
        self._taken: dict[Symbol, bool] = {}

    def symbol(self, operation: str, *operands: Operand) -> Symbol:
        key = operation, *(id(o) if isinstance(o, Symbol) else (o,) for o in operands)
        return self._symbols.setdefault(key, Symbol(operation, operands, self))

    def decide(self, condition: Symbol) -> bool:
        contrary = _CONTRARY.get(condition.operation)
        if contrary and self._taken.get(self.symbol(contrary, *condition.operands)):
            return False
        if condition not in self._taken:
            number = len(self._taken)
            self._taken[condition] = number >= len(self._given) or self._given[number]
        return self._taken[condition]

    def tree(self, run: _Run, given: tuple[bool, ...] = ()) -> Result | Decision:
        """Return the decisions and results on all ways that begin with the decisions given."""
        if len(given) > _MOST_DECISIONS:
            raise InvalidInputError(
                f"it makes more than {_MOST_DECISIONS} comparisons in a row; at most "
                f"{_MOST_DECISIONS} are exported"
            )
        self._given, self._taken = given, {}
        result = run(self.symbol)
        if len(self._taken) == len(given):
            if not all(isinstance(v, Symbol) or isfinite(v) for v in result.values):
                raise ValueError("not finite")
            return result
        condition = [*self._taken][len(given)]
        holds, fails = (self.tree(run, (*given, holds)) for holds in (True, False))
        return holds if holds.key == fails.key else Decision(condition, holds, fails)


_INPUTS = (
    "position", "velocity", "belt_velocity", "motor_position", "motor_velocity",
    "reference_position", "reference_velocity", "reference_acceleration",
)  # fmt: skip


def law_program(law: ControlLaw, period: float) -> LawProgram:
    """Return the program of a law.

    Parameters
    ----------
    law : ControlLaw
        Law; its limit of the force and its delay of the start are left to the user of the program.
    period : float
        Sample period, s.

    Raises
    ------
    InvalidInputError
        If the law computes with something other than sums, products, quotients, powers, absolute
        values, exponentials and comparisons, or makes too many comparisons.
    """
    states = tuple(f"self.{name}" for name in law.state_units)

    def first(symbol: Callable[[str], Symbol]) -> Result:
        sample, reference = _inputs(symbol, law)
        state = law.initial_state(sample, reference)
        return Result(*law.respond(state, 0.0, sample, reference))

    def following(symbol: Callable[[str], Symbol]) -> Result:
        state: Any = tuple(map(symbol, states))
        return Result(*law.respond(state, period, *_inputs(symbol, law)))

    try:
        explorer = _Explorer()
        trees = explorer.tree(first), explorer.tree(following)
    except Exception as error:  # the code of others: anything
        reason = (
            str(error)
            if isinstance(error, InvalidInputError)
            else "it computes with more than sums, products, quotients, powers, absolute values, "
            f"exponentials and comparisons ({in_words(error)})"
        )
        raise InvalidInputError(
            f"the control law {law.name} cannot be exported: {reason}"
        ) from None
    values = (value for tree in trees for value in tree.all_values())
    used = {s.operation for value in values for s in _symbols(value) if not s.operands}
    if unknown := sorted(used - {*states, *_INPUTS}):
        raise InvalidInputError(
            f"the control law {law.name} cannot be exported: it uses {', '.join(unknown)} of the "
            "samples"
        )
    return LawProgram(states, tuple(name for name in _INPUTS if name in used), *trees)


def _inputs(symbol: Callable[[str], Symbol], law: ControlLaw) -> tuple[Any, Any]:
    motor = MotorSample._make(map(symbol, _INPUTS[3:5]))
    sample = Sample._make([*map(symbol, Sample._fields[:-1]), motor])
    reference: Any = map(symbol, _INPUTS[5:]) if law.follows_reference else ()
    return sample, Reference(*reference)


def _symbols(value: Operand) -> Iterator[Symbol]:
    """Yield every symbol of a value, those of shared operands repeatedly."""
    if isinstance(value, Symbol):
        yield value
        for operand in value.operands:
            yield from _symbols(operand)


def _is(value: Operand, number: float) -> bool:
    return not isinstance(value, Symbol) and value == number


def _negative(value: Operand) -> Operand | None:
    """Return the value with the other sign if it is a negative number, or one times something."""
    if not isinstance(value, Symbol):
        return -value if value < 0.0 else None
    if value.operation == "*" and isinstance(factor := value.operands[0], float) and factor < 0.0:
        return -factor * value.operands[1]
    return None
