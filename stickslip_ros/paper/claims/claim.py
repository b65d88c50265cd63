"""Claims of the paper, and how a computation judges them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from enum import StrEnum
from functools import cache
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from stickslip_ros.paper.figures import BifurcationFigure, PaperFigure, PortraitFigure

_ROUNDING = 1e-9
"""Share of the largest value, or of one, below which a difference is rounding only."""


class Verdict(StrEnum):
    """The result of a computation for a claim."""

    HOLDS = "holds"
    CORRECTED = "holds with a correction"
    FAILS = "does not hold"
    UNDECIDABLE = "not decidable"


@dataclass(frozen=True)
class Finding:
    """A claim compared with the result of the equations."""

    computed: float | str | None
    """The number, or the result in words; None if not decidable."""
    difference: float | None
    """Computed minus printed number; for a formula the largest deviation at the tested points."""
    verdict: Verdict
    remark: str
    """The correction, or why it does not hold or is not decidable, and further evidence."""


class Evidence:
    """The computed figures, each computed when a claim first needs it."""

    def __init__(self, figure: Callable[[int], PaperFigure]) -> None:
        """Take a function that returns the figure with a number, such as `compute_figure`."""
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


class Computed(Protocol):
    """The result of the computation for a claim."""

    def finding(self, printed: Any, /) -> Finding:
        """Judge the printed number or formula, or None for a statement in words."""
        ...


@dataclass(frozen=True)
class Claim:
    """A number, a formula or a statement of the paper."""

    identifier: str
    """Unique, and the same in all versions."""
    place: str
    """Place in the paper: equation, figure or section."""
    statement: str
    """The claim, in our words."""
    printed: float | str | None
    """The number or the formula as printed; None for a statement in words."""
    compute: Callable[[Evidence], Computed]
    """Computes the subject of the claim."""

    def check(self, evidence: Evidence) -> Finding:
        """Compute the subject of the claim, and judge it."""
        return self.compute(evidence).finding(self.printed)


class Chapter(NamedTuple):
    """The claims of a part of the paper, in order."""

    title: str
    claims: tuple[Claim, ...]


_Computation = TypeVar("_Computation", bound=Callable[..., Computed])


class Computations(dict[str, Callable[[Evidence], Computed]]):
    """The computations of the claims in a file, by their identifier."""

    def __call__(self, claim: str, *arguments: Any) -> Callable[[_Computation], _Computation]:
        """Return a decorator for the function that computes the subject of a claim.

        The function takes the evidence and the `arguments`; with other arguments it may compute
        other claims. A single expression needs no decorator:
        `computes[claim] = lambda evidence: ...`.
        """

        def add(compute: _Computation) -> _Computation:
            self[claim] = lambda evidence: compute(evidence, *arguments)
            return compute

        return add


@dataclass(frozen=True)
class Number:
    """The result of the equations for a printed number.

    It holds if the computed number, rounded to the last printed digit, equals the printed one.
    """

    value: float
    corrections: Mapping[str, float] = field(default_factory=dict[str, float])
    """Results of other calculations, by their difference, such as "With i in front".

    The first one that gives the printed number counts.
    """
    remark: str = ""

    def finding(self, printed: float) -> Finding:
        """Judge the printed number."""
        verdict, remark = Verdict.FAILS, self.remark
        if agrees(printed, self.value):
            verdict = Verdict.HOLDS
        else:
            for correction, value in self.corrections.items():
                if agrees(printed, value):
                    verdict = Verdict.CORRECTED
                    remark = f"{correction}: {value:.6g}. {remark}"
                    break
        difference = self.value - printed
        if abs(difference) <= _ROUNDING * max(1.0, abs(printed)):
            difference = 0.0
        return Finding(self.value, difference, verdict, remark.strip())


@dataclass(frozen=True)
class Formula:
    """The values of a printed formula at some points, and the true values.

    It holds if its values are the true ones up to rounding.
    """

    printed: npt.ArrayLike | None
    """None if it cannot be evaluated as printed."""
    true: npt.ArrayLike
    """From the equations or a definition, by another method."""
    corrections: Mapping[str, npt.ArrayLike] = field(default_factory=dict[str, npt.ArrayLike])
    """Values of corrected formulas; the first one that agrees with the true ones counts."""
    remark: str = ""

    def finding(self, _: Any) -> Finding:
        """Judge the printed formula by its values."""
        true = np.asarray(self.true)
        rounding = _ROUNDING * max(1.0, float(np.abs(true).max()))
        difference = None if self.printed is None else _distance(self.printed, true)
        verdict, remark = Verdict.FAILS, self.remark
        if difference is not None and difference <= rounding:
            verdict, found, difference = Verdict.HOLDS, "the same", 0.0
        else:
            found = "cannot be evaluated" if difference is None else "something else"
            for correction, values in self.corrections.items():
                if _distance(values, true) <= rounding:
                    verdict = Verdict.CORRECTED
                    remark = f"{correction} it agrees. {remark}"
                    break
        return Finding(found, difference, verdict, remark.strip())


@dataclass(frozen=True)
class Observation:
    """The result of the computation for a statement in words."""

    found: float | str
    holds: bool
    holds_corrected: bool = False
    """Whether it holds with the correction that the remark states."""
    remark: str = ""

    def finding(self, _: Any) -> Finding:
        """Judge the statement."""
        verdict = Verdict.FAILS
        if self.holds:
            verdict = Verdict.HOLDS
        elif self.holds_corrected:
            verdict = Verdict.CORRECTED
        return Finding(self.found, None, verdict, self.remark)


@dataclass(frozen=True)
class Undecidable:
    """No result: no computation can decide the statement."""

    why: str

    def finding(self, _: Any) -> Finding:
        """Return the verdict "not decidable" with the reason."""
        return Finding(None, None, Verdict.UNDECIDABLE, self.why)


def agrees(printed: float, computed: float) -> bool:
    """Return whether `computed` equals `printed`, to half a unit of the last printed digit."""
    exponent = Decimal(repr(printed)).as_tuple().exponent
    assert isinstance(exponent, int)
    return abs(computed - printed) <= 0.5 * 10.0**exponent * (1.0 + 1e-9)


def _distance(values: Any, true: Any) -> float:
    return float(np.abs(np.asarray(values) - true).max())
