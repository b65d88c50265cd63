"""Fitted models that compete, and the choice between them by the prediction of held-out parts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import copysign, inf, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.intervals import QUANTILE
from stickslip_ros.identification.refinement import Refinement
from stickslip_ros.identification.regression import Regression

_SIGNIFICANT = 3.0
"""Standard errors by which a model must predict better to be preferred to a simpler one."""
_LEAST_GAIN = 0.01
"""Share of the error by which it must be better besides."""


@dataclass(frozen=True)
class Estimate:
    """A fitted constant."""

    value: float
    """Value, SI units."""
    standard_error: float
    """Standard error, SI units."""

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        half = QUANTILE * self.standard_error
        return self.value - half, self.value + half


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted model with what it predicts of parts that it was not fitted to."""

    law: str
    """Friction law."""
    size: int
    """Number of fitted constants."""
    held_out: FloatArray
    """Mean square of the error in each held-out part, N^2 of forces or m^2 of positions."""
    scale: float
    """Root mean square of what is predicted, N or m."""
    fit: Regression | Refinement
    """The fit."""
    delay: float | None = None
    """Time from a sample until its force acts, s; None if nothing asks for one."""
    by_direction: bool = False
    """Whether a law on a spring has constants of its own in each direction."""
    remark: str = ""
    """Restriction of the model, or reason why it is out of the choice."""

    @property
    def label(self) -> str:
        """Name of the law, and whether it is by direction."""
        return f"{self.law} by direction" if self.by_direction else self.law

    @property
    def error(self) -> float:
        """Root mean square of the held-out error, as a share of the scale."""
        known = len(self.held_out) and self.scale > 0.0
        return sqrt(float(np.mean(self.held_out))) / self.scale if known else inf


def better_by(better: Candidate, worse: Candidate) -> float:
    """Return by how many standard errors one model predicts better than the other.

    Less than one per cent counts as nothing. It compares the logarithms of the errors part by part:
    a single bad part decides nothing. Models that were not compared on the same parts are told
    apart by their errors alone.
    """
    if len(better.held_out) != len(worse.held_out):
        return copysign(inf, worse.error - better.error)
    if worse.error < (1.0 + _LEAST_GAIN) * better.error:
        return 0.0
    tiny = np.finfo(float).tiny
    ratios = np.log(np.maximum(worse.held_out, tiny) / np.maximum(better.held_out, tiny))
    mean, count = float(np.mean(ratios)), len(ratios)
    error = float(np.std(ratios, ddof=1)) / sqrt(count) if count > 1 else 0.0
    return mean / error if error > 0.0 else copysign(inf, mean) if mean else 0.0


def choose(candidates: Sequence[Candidate]) -> tuple[Candidate, Mapping[str, bool]]:
    """Return the simplest model that predicts as well as any, and which others do, by label.

    A model is as good as the best one if the difference of their held-out errors is within three
    standard errors, from its scatter over the parts.
    """
    best = min(candidates, key=lambda each: each.error)
    as_good = [each for each in candidates if each is best or better_by(best, each) < _SIGNIFICANT]
    chosen = min(as_good, key=lambda each: (each.size, each.error))
    return chosen, {each.label: each in as_good for each in candidates}
