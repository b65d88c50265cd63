"""Results of computations for the claims of the paper, and how they decide the verdict."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from enum import StrEnum
from functools import cache
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from reproduction.figures import BifurcationFigure, PaperFigure, PortraitFigure

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
    """The number, or the result in words; None if not decidable, or if the row has the words."""
    difference: float | None
    """Computed minus printed number; for a formula the largest deviation at the tested points."""
    verdict: Verdict
    remark: str = ""
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


class Result:
    """The result of the computation for a claim; `values` fill in the words of its row."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.values = values

    def judge(self, printed: Any) -> Finding:
        """Judge the printed number or formula, or None for a statement in words."""
        raise NotImplementedError


class Number(Result):
    """The result of the equations for a printed number.

    It holds if the computed number, rounded to the last printed digit, equals the printed one.
    `corrections` are results of other calculations, by their difference, such as "With i in front";
    the first one that gives the printed number counts.
    """

    def __init__(
        self, value: float, corrections: Mapping[str, float] | None = None, /, **values: Any
    ) -> None:
        super().__init__(values)
        self._value, self._corrections = value, corrections or {}

    def judge(self, printed: Any) -> Finding:
        """Judge the printed number."""
        difference = self._value - printed
        if abs(difference) <= _ROUNDING * max(1.0, abs(printed)):
            difference = 0.0
        verdict, correction = Verdict.FAILS, ""
        if agrees(printed, self._value):
            verdict = Verdict.HOLDS
        else:
            for what, value in self._corrections.items():
                if agrees(printed, value):
                    verdict, correction = Verdict.CORRECTED, f"{what}: {value:.6g}."
                    break
        return Finding(self._value, difference, verdict, correction)


class Formula(Result):
    """The values of a printed formula at some points, and the true values.

    It holds if its values, None if it cannot be evaluated as printed, are the true ones up to
    rounding. The true ones are from the equations or a definition, by another method.
    `corrections` are values of corrected formulas; the first one that agrees counts.
    """

    def __init__(
        self,
        printed: npt.ArrayLike | None,
        true: npt.ArrayLike,
        corrections: Mapping[str, npt.ArrayLike] | None = None,
        /,
        **values: Any,
    ) -> None:
        super().__init__(values)
        self._printed, self._true, self._corrections = printed, true, corrections or {}

    def judge(self, printed: Any) -> Finding:
        """Judge the printed formula by its values."""
        true = np.asarray(self._true)
        rounding = _ROUNDING * max(1.0, float(np.abs(true).max()))
        difference = None if self._printed is None else _distance(self._printed, true)
        if difference is not None and difference <= rounding:
            return Finding("the same", 0.0, Verdict.HOLDS)
        found = "cannot be evaluated" if difference is None else "something else"
        for correction, values in self._corrections.items():
            if _distance(values, true) <= rounding:
                return Finding(found, difference, Verdict.CORRECTED, f"{correction} it agrees.")
        return Finding(found, difference, Verdict.FAILS)


class Observation(Result):
    """The result for a statement in words: whether it holds, or with the correction of its row."""

    def __init__(self, holds: bool, holds_corrected: bool = False, /, **values: Any) -> None:
        super().__init__(values)
        self._holds, self._holds_corrected = holds, holds_corrected

    def judge(self, printed: Any) -> Finding:
        """Judge the statement."""
        if self._holds:
            return Finding(None, None, Verdict.HOLDS)
        return Finding(None, None, Verdict.CORRECTED if self._holds_corrected else Verdict.FAILS)


_Computation = TypeVar("_Computation", bound=Callable[..., Result])


class Computations(dict[str, Callable[[Evidence], Result]]):
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


def agrees(printed: float, computed: float) -> bool:
    """Return whether `computed` equals `printed`, to half a unit of the last printed digit."""
    exponent = Decimal(repr(printed)).as_tuple().exponent
    assert isinstance(exponent, int)
    return abs(computed - printed) <= 0.5 * 10.0**exponent * (1.0 + 1e-9)


def _distance(values: Any, true: Any) -> float:
    return float(np.abs(np.asarray(values) - true).max())
