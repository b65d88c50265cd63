"""The choice of a law: candidates, compared by what they predict of held-out parts."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import copysign, inf, sqrt
from typing import Generic

import numpy as np
from typing_extensions import TypeVar

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.fit import Fit
from stickslip_ros.identification.identified_law import IdentifiedLaw
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.time_limit import TimeLimit

_SIGNIFICANT = 3.0
"""Standard errors by which a model must predict better to be preferred to a simpler one."""
_LEAST_GAIN = 0.01
"""Share of the error by which it must be better besides."""
AUTO = "auto"
"""Law that stands for the one that predicts held-out parts best."""

_Fit = TypeVar("_Fit", bound=Fit, default=Fit, infer_variance=True)


@dataclass(frozen=True, eq=False)
class Candidate(Generic[_Fit]):
    """A fitted model with what it predicts of parts that it was not fitted to."""

    fit: _Fit
    """The fit."""
    held_out: FloatArray
    """Mean square of the error in each held-out part, N^2 of forces or m^2 of positions."""
    remark: str = ""
    """Restriction of the model, or reason why it is out of the choice."""

    @property
    def law(self) -> str:
        """Friction law."""
        return self.fit.law.name

    @property
    def size(self) -> int:
        """Number of fitted constants."""
        return len(self.fit.point) + (self.fit.law.deflection > 0.0)

    @property
    def by_direction(self) -> bool:
        """Whether a law on a spring has constants of its own in each direction."""
        return self.fit.has_spring and self.fit.law.one_way is not self.fit.law

    @property
    def label(self) -> str:
        """Name of the law, and whether it is by direction."""
        return f"{self.law} by direction" if self.by_direction else self.law

    @property
    def error(self) -> float:
        """Validation error: rms of what is held out, as a share of the scale."""
        known = len(self.held_out) and self.fit.scale > 0.0
        return sqrt(float(np.mean(self.held_out))) / self.fit.scale if known else inf


def better_by(better: Candidate, worse: Candidate) -> float:
    """Return by how many standard errors one model predicts better than the other.

    Less than one per cent, or than `Fit.least_gain`, counts as nothing. It compares the logarithms
    of the errors part by part: a single bad part decides nothing. Models that were not compared on
    the same parts are told apart by their errors alone.
    """
    if len(better.held_out) != len(worse.held_out):
        return copysign(inf, worse.error - better.error)
    if worse.error < (1.0 + _LEAST_GAIN) * better.error + better.fit.least_gain:
        return 0.0
    tiny = np.finfo(float).tiny
    ratios = np.log(np.maximum(worse.held_out, tiny) / np.maximum(better.held_out, tiny))
    mean, count = float(np.mean(ratios)), len(ratios)
    error = float(np.std(ratios, ddof=1)) / sqrt(count) if count > 1 else 0.0
    return mean / error if error > 0.0 else copysign(inf, mean) if mean else 0.0


def choose(
    candidates: Sequence[Candidate[_Fit]],
) -> tuple[Candidate[_Fit], Mapping[str, bool]]:
    """Return the simplest model that predicts as well as any, and which others do, by label.

    A model is as good as the best one if the difference of their validation errors is within three
    standard errors, from its scatter over the parts, or if it is simpler and better than such a
    one. A model with constants that the records do not tell is chosen only if all have some.
    """
    best = min(candidates, key=lambda each: each.error)
    near = [each for each in candidates if each is best or better_by(best, each) < _SIGNIFICANT]
    # An error that scatters much is within it, too: what is simpler and better is as good as that.
    as_good = [
        each
        for each in candidates
        if any(each.size <= other.size and each.error <= other.error for other in near)
    ]
    told = [each for each in as_good if np.isfinite(np.diag(each.fit.covariance)).all()]
    chosen = min(told or as_good, key=lambda each: (each.size, each.error))
    return chosen, {each.label: each in as_good for each in candidates}


class Task(ABC, Generic[_Fit]):
    """Records of a drive to which laws are fitted, with what is known of it."""

    def __init__(self, records: Sequence[Record], limit: TimeLimit) -> None:
        """Take the records, and the time that all fits may take."""
        self.records, self.limit = records, limit
        self.left: list[str] = []
        """Laws that were not fitted to the end, because the time was over."""

    @abstractmethod
    def candidates(
        self, law: str, laws: Sequence[IdentifiedLaw], progress: Callable[[str], None]
    ) -> list[Candidate[_Fit]]:
        """Return the fits of the laws that compete, or of the one that is asked for."""

    def adjusted(self, found: Candidate[_Fit]) -> Candidate[_Fit]:
        """Return what was chosen as it is used."""
        return found

    def chosen(
        self, law: str, laws: Sequence[IdentifiedLaw], progress: Callable[[str], None]
    ) -> tuple[Sequence[Candidate], Candidate, Mapping[str, bool]]:
        """Return all candidates, the one that is used, and which predict as well, by label."""
        candidates = self.candidates(law, laws, progress)
        in_choice = [each for each in candidates if law != AUTO or not each.remark]
        found, as_good = choose(in_choice or candidates)
        return candidates, self.adjusted(found), as_good
