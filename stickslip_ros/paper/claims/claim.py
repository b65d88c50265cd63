"""What a claim of the paper is, and how a computation judges it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from enum import StrEnum
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from stickslip_ros.paper.figures import BifurcationFigure, PaperFigure, PortraitFigure

_SLACK = 1e-9
"""Share of half a unit of the last printed digit that rounding may add to it."""

_ROUNDING = 1e-9
"""Share of the largest value, or of one, below which a difference is rounding alone."""


class Verdict(StrEnum):
    """What the computation says of a claim."""

    HOLDS = "holds"
    CORRECTED = "holds with a correction"
    FAILS = "does not hold"
    UNDECIDABLE = "not decidable"


@dataclass(frozen=True)
class Finding:
    """A claim beside what the equations give."""

    computed: float | str | None
    """The number, or in words or several numbers what was found; None if not decidable."""
    difference: float | None
    """Computed less printed number; of a formula the largest deviation over the points tried."""
    verdict: Verdict
    remark: str
    """Which correction, or why it does not hold or is not decidable, and further evidence."""


class Evidence:
    """The computed figures, each asked for when a claim first wants it."""

    def __init__(self, figure: Callable[[int], PaperFigure]) -> None:
        """Take a function that gives the figure of a number, such as `compute_figure`."""
        self._figure = cache(figure)

    def bifurcation(self, number: int) -> BifurcationFigure:
        """Return one of the figures 2 to 5."""
        figure = self._figure(number)
        assert isinstance(figure, BifurcationFigure)
        return figure

    def portraits(self, number: int) -> PortraitFigure:
        """Return one of the figures 6 to 13."""
        figure = self._figure(number)
        assert isinstance(figure, PortraitFigure)
        return figure


@dataclass(frozen=True)
class Claim:
    """A number, a formula or a statement of the paper."""

    identifier: str
    """Unique, and the same from one version to the next."""
    place: str
    """Where the paper has it: equation, figure or section."""
    statement: str
    """What it says, in our words."""
    printed: float | str | None
    """The number or the formula as printed, None for a statement in words."""
    judge: Callable[[Any, Evidence], Finding]
    """Judges what is printed."""

    def check(self, evidence: Evidence) -> Finding:
        """Compute what the claim is about, and judge it."""
        return self.judge(self.printed, evidence)


@dataclass(frozen=True)
class Correction:
    """Another calculation, which may be the one that gives what is printed."""

    description: str
    """What is different in it, such as "With i in front"."""
    value: Any
    """A number, or the values of a formula."""


@dataclass(frozen=True)
class Number:
    """What the equations give for a printed number."""

    value: float
    corrections: Sequence[Correction] = ()
    """The first one that gives what is printed counts."""
    remark: str = ""


@dataclass(frozen=True)
class Formula:
    """The values of a printed formula at some points, and what they must be."""

    printed: npt.ArrayLike | None
    """None if it cannot be evaluated as it stands."""
    true: npt.ArrayLike
    """From the equations or a definition, by another way."""
    corrections: Sequence[Correction] = ()
    """Values of corrected formulas; the first one that agrees with the true ones counts."""
    remark: str = ""


@dataclass(frozen=True)
class Observation:
    """What the computation shows of a statement in words."""

    found: float | str
    holds: bool
    holds_corrected: bool = False
    """Whether it holds with the correction that the remark states."""
    remark: str = ""


class Chapter:
    """The claims of a part of the paper, in its order.

    Its methods make decorators for the function that computes what a claim is about.
    """

    def __init__(self, title: str) -> None:
        self.title = title
        self.claims: list[Claim] = []

    def number(
        self, identifier: str, place: str, statement: str, printed: float
    ) -> Callable[[Callable[[Evidence], Number]], None]:
        """Add a number, which holds if the computed one is it when rounded to its last digit."""

        def add(compute: Callable[[Evidence], Number]) -> None:
            def judge(printed: float, evidence: Evidence) -> Finding:
                return _judge_number(printed, compute(evidence))

            self.claims.append(Claim(identifier, place, statement, printed, judge))

        return add

    def formula(
        self, identifier: str, place: str, statement: str, printed: str
    ) -> Callable[[Callable[[], Formula]], None]:
        """Add a formula, which holds if its values are the true ones but for rounding."""

        def add(compute: Callable[[], Formula]) -> None:
            def judge(_: str, __: Evidence) -> Finding:
                return _judge_formula(compute())

            self.claims.append(Claim(identifier, place, statement, printed, judge))

        return add

    def statement(
        self, identifier: str, place: str, statement: str
    ) -> Callable[[Callable[[Evidence], Observation]], None]:
        """Add a statement in words."""

        def add(compute: Callable[[Evidence], Observation]) -> None:
            def judge(_: None, evidence: Evidence) -> Finding:
                return _judge_observation(compute(evidence))

            self.claims.append(Claim(identifier, place, statement, None, judge))

        return add

    def undecidable(self, identifier: str, place: str, statement: str, why: str) -> None:
        """Add a statement of which no computation can say anything."""
        finding = Finding(None, None, Verdict.UNDECIDABLE, why)
        self.claims.append(Claim(identifier, place, statement, None, lambda _, __: finding))


def agrees(printed: float, computed: float) -> bool:
    """Return whether `computed` is what is printed, to half a unit of the last printed digit."""
    exponent = Decimal(repr(printed)).as_tuple().exponent
    assert isinstance(exponent, int)
    return abs(computed - printed) <= 0.5 * 10.0**exponent * (1.0 + _SLACK)


def _judge_number(printed: float, number: Number) -> Finding:
    verdict, remark = Verdict.FAILS, number.remark
    if agrees(printed, number.value):
        verdict = Verdict.HOLDS
    else:
        for correction in number.corrections:
            if agrees(printed, correction.value):
                verdict = Verdict.CORRECTED
                remark = f"{correction.description}: {correction.value:.6g}. {remark}"
                break
    difference = number.value - printed
    if abs(difference) <= _ROUNDING * max(1.0, abs(printed)):
        difference = 0.0
    return Finding(number.value, difference, verdict, remark.strip())


def _judge_formula(formula: Formula) -> Finding:
    true = np.asarray(formula.true)
    rounding = _ROUNDING * max(1.0, float(np.abs(true).max()))
    difference = None if formula.printed is None else _distance(formula.printed, true)
    verdict, remark = Verdict.FAILS, formula.remark
    if difference is not None and difference <= rounding:
        verdict, found, difference = Verdict.HOLDS, "the same", 0.0
    else:
        found = "cannot be evaluated" if difference is None else "something else"
        for correction in formula.corrections:
            if _distance(correction.value, true) <= rounding:
                verdict = Verdict.CORRECTED
                remark = f"{correction.description} it agrees. {remark}"
                break
    return Finding(found, difference, verdict, remark.strip())


def _distance(values: Any, true: Any) -> float:
    return float(np.abs(np.asarray(values) - true).max())


def _judge_observation(observation: Observation) -> Finding:
    verdict = Verdict.FAILS
    if observation.holds:
        verdict = Verdict.HOLDS
    elif observation.holds_corrected:
        verdict = Verdict.CORRECTED
    return Finding(observation.found, None, verdict, observation.remark)
