"""A control law for a drive without ROS: its program as C99 or as IEC 61131-3 Structured Text."""

import re
from collections import Counter
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field
from inspect import getdoc
from math import isfinite

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import constants_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show.law_program import (
    Decision,
    LawProgram,
    Operand,
    Result,
    Symbol,
    law_program,
)
from stickslip_ros.text import printable

_RANK = {"+": 1, "-": 1, "*": 2, "/": 2}
"""How tightly operators bind."""

_UNITS = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}
"""Units of the inputs, by the last word of their names."""


@dataclass(frozen=True)
class Language:
    """How a language writes statements, and the template of a file."""

    template: str
    """Name of the template of a file."""
    variable: str
    """Statement that makes a variable."""
    assignment: str
    """Statement that gives a variable a value."""
    branch: tuple[str, str, str]
    """Lines that begin a branch under a condition, the other one, and the end."""
    state: str
    """Prefix of the states of the law."""
    samples: str
    """Number of samples so far."""
    names: Mapping[str, str] = field(default_factory=dict[str, str])
    """Its operators and functions where they are not those of C."""


LANGUAGES: Mapping[str, Language] = {
    ".c": Language(
        "law.c.jinja", "const double {} = {};", "{} = {};", ("if ({}) {{", "}} else {{", "}}"),
        "self->", "self->samples",
    ),
    ".st": Language(
        "law.st.jinja", "{} := {};", "{} := {};", ("IF {} THEN", "ELSE", "END_IF;"),
        "kept_", "samples", {"==": "=", "fabs": "ABS", "exp": "EXP", "pow": "EXPT"},
    ),
}  # fmt: skip
"""Languages by the ending of a file."""


@dataclass(frozen=True)
class Difference:
    """A velocity that the code computes as a difference of positions, as the sensor does."""

    velocity: str
    """Name of the velocity."""
    position: str
    """Name of the position, an input."""
    spans: int
    """Number of samples that the difference spans."""


def law_code(scenario: Scenario, language: Language) -> str:
    """Return the source file of the control law of a scenario, at the rate of its answers.

    Raises InvalidInputError if the law cannot be exported, see `law_program`.
    """
    from jinja2 import Environment, PackageLoader

    plant, law = scenario.plant, scenario.controller.control_law
    program = law_program(law, 1.0 / plant.control_rate)
    differences: list[Difference] = []
    for body, sensor in (("", plant.sensor), ("motor_", plant.motor.sensor)):
        if not sensor.spans or f"{body}velocity" not in program.inputs:
            continue
        if (seen := sensor.every(plant.answer_every)) is None:
            raise InvalidInputError(
                f"the velocity is a difference over {sensor.spans} samples: must be a multiple of "
                f"plant.answer_every = {plant.answer_every}, at which the code is called"
            )
        differences.append(Difference(f"{body}velocity", f"{body}position", seen.spans))
    computed = [difference.velocity for difference in differences]
    names = dict.fromkeys([*(d.position for d in differences), *program.inputs])
    statements = list(_Writer(language, program).statements())
    variables = {m[1] for line in statements if (m := re.match(r" *(t\d+|next_\d+) :=", line))}
    template = Environment(
        loader=PackageLoader("stickslip_ros", "show"),
        trim_blocks=False, keep_trailing_newline=True, autoescape=False,
    ).get_template(language.template)  # fmt: skip
    text = template.render(
        name=law.name,
        # Nothing in a name or in a docstring ends the comment.
        head=[re.sub(r"\*(?=[/)])", "* ", printable(line)) for line in _head(scenario)],
        inputs={name: _UNITS[name.rpartition("_")[2]] for name in names if name not in computed},
        states=[state.partition(".")[2] for state in program.states],
        differences=differences,
        period=_number(1.0 / plant.control_rate),
        statements=statements,
        variables=sorted(variables),
        limit=_number(law.force_limit) if isfinite(law.force_limit) else "",
    )
    return re.sub(" +$", "", text, flags=re.MULTILINE)


def _head(scenario: Scenario) -> Iterator[str]:
    """Yield the lines of the comment at the top: law, source, numbers, units, rate."""
    law = scenario.controller.control_law
    yield f"The control law {law.name} of the scenario {scenario.name}."
    yield from ("", *(getdoc(type(law)) or "").splitlines(), "")
    period = 1.0 / scenario.plant.control_rate
    yield f"Call it once each {period:.17g} s. All values are in SI units:"
    for name, described in constants_of(type(law)).items():
        value = getattr(law, name)
        if isinstance(value, float | str):
            unit = f" {described.unit}" if described.unit else ""
            yield f"  {name} = {value}{unit}: {described.meaning}"
    if law.start_after > 0.0:
        yield "start_after is not part of the code: call it from the first sample on, and apply its"
        yield "force from that time on."


def _number(value: float) -> str:
    """Return a literal of either language, with all digits."""
    mantissa, exponent, power = repr(float(value)).partition("e")
    return (mantissa if "." in mantissa else f"{mantissa}.0") + exponent.upper() + power


class _Writer:
    """Writes the statements of a program in a language."""

    def __init__(self, language: Language, program: LawProgram) -> None:
        self._language, self._program = language, program

    def statements(self) -> Iterator[str]:
        """Yield the statements that answer a sample."""
        if self._program.first.key == self._program.next.key:
            yield from self._block(self._program.next, {})
            return
        is_first = f"{self._language.samples} {self._name('==')} 0"
        begin, otherwise, end = self._language.branch
        yield begin.format(is_first)
        yield from self._indented(self._program.first, {})
        yield otherwise.format()
        yield from self._indented(self._program.next, {})
        yield end.format()

    def _indented(self, tree: Result | Decision, known: dict[Symbol, str]) -> Iterator[str]:
        return (f"    {line}" for line in self._block(tree, dict(known)))

    def _block(self, tree: Result | Decision, known: dict[Symbol, str]) -> Iterator[str]:
        """Yield the statements of a tree, given the variables that are known."""
        language = self._language
        for symbol in _shared(tree, known):
            value = self._expression(symbol, known)
            known[symbol] = f"t{len(known) + 1}"
            yield language.variable.format(known[symbol], value)
        if isinstance(tree, Decision):
            begin, otherwise, end = language.branch
            yield begin.format(self._expression(tree.condition, known))
            yield from self._indented(tree.holds, known)
            yield otherwise.format()
            yield from self._indented(tree.fails, known)
            yield end.format()
            return
        yield language.assignment.format("force", self._expression(tree.force, known))
        states = [self._leaf(state) for state in self._program.states]
        after = [self._expression(value, known) for value in tree.state]
        for number, (state, value) in enumerate(zip(states, after, strict=True), 1):
            if any(state in later for later in after[number:]):
                yield language.variable.format(f"next_{number}", value)
                after[number - 1] = f"next_{number}"
        for state, value in zip(states, after, strict=True):
            if state != value:
                yield language.assignment.format(state, value)

    def _leaf(self, name: str) -> str:
        return name.replace("self.", self._language.state)

    def _name(self, operation: str) -> str:
        return self._language.names.get(operation, operation)

    def _expression(self, value: Operand, known: Mapping[Symbol, str], within: int = 0) -> str:
        """Return an expression, in parentheses if what it stands `within` binds more tightly."""
        if not isinstance(value, Symbol):
            return f"({_number(value)})" if value < 0.0 and within else _number(value)
        if value in known:
            return known[value]
        operation, operands = value.operation, value.operands
        if not operands:
            return self._leaf(operation)
        rank = _RANK.get(operation)
        if len(operands) == 2 and operation != "pow":
            ranks = (0, 0) if rank is None else (rank, rank + 1)
            sides = (self._expression(o, known, r) for o, r in zip(operands, ranks, strict=True))
            text = f" {self._name(operation)} ".join(sides)
            return f"({text})" if (rank or 0) < within else text
        if operation == "-":
            return f"(-{self._expression(operands[0], known, 3)})"
        arguments = ", ".join(self._expression(operand, known) for operand in operands)
        if operation == "expm1" and "exp" in self._language.names:
            return f"({self._name('exp')}({arguments}) - 1.0)"
        return f"{self._name(operation)}({arguments})"


def _shared(tree: Result | Decision, known: Container[Symbol]) -> list[Symbol]:
    """Return the operations in the values of a root that its tree repeats, innermost first."""
    uses = Counter[Symbol]()

    def count(value: Operand) -> None:
        if isinstance(value, Symbol) and value.operands:
            uses[value] += 1
            if uses[value] == 1:
                for operand in value.operands:
                    count(operand)

    def innermost(value: Operand) -> Iterator[Symbol]:
        if isinstance(value, Symbol) and value.operands and value not in known:
            for operand in value.operands:
                yield from innermost(operand)
            yield value

    for value in tree.all_values():
        count(value)
    symbols = dict.fromkeys(symbol for value in tree.values for symbol in innermost(value))
    return [symbol for symbol in symbols if uses[symbol] > 1]
