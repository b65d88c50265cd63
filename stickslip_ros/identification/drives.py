"""Identification of drives on a spring: friction laws compete for the records."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from math import inf

from stickslip_ros.arrays import rms
from stickslip_ros.identification.choice import AUTO
from stickslip_ros.identification.fit import OUT_OF_TIME
from stickslip_ros.identification.identified_law import IdentifiedLaw, label_of
from stickslip_ros.identification.law_search import LawSearch, remarked
from stickslip_ros.identification.laws import DAHL, LUGRE, DirectionalAdapter
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.refinement import Refinement, loss_of
from stickslip_ros.identification.time_limit import TimeLimit

_SEARCH_TIME = 0.7
"""Share of the time in which laws are searched; in the rest the best ones are fitted further."""
_LAW_TIME = 0.25
"""Share of what is left of it that the search of a law without a memory may take: others follow."""
_MISSING_INPUT_ERROR = 0.5
"""Error, as a share of the motion, from which a memory is not tried: an input is missing."""
_HOPELESS_LOSS_RATIO = 4.0
"""A law whose squared error is larger by this factor after its search is not fitted further."""
_HOPELESS = "much worse in the search: not fitted further"


class DriveTask:
    """Records of a drive on a spring, for which laws compete."""

    def __init__(
        self, records: Sequence[Record], fixed: Mapping[str, float], limit: TimeLimit
    ) -> None:
        self._search, self._limit = LawSearch(records, fixed, limit), limit
        self.left: list[str] = []
        """Laws that were not fitted to the end, because the time was over."""
        self._models: list[Refinement] = []

    def candidates(
        self, law: str, laws: Sequence[IdentifiedLaw], progress: Callable[[str], None]
    ) -> list[Refinement]:
        """Return the fits of the laws that compete, or of the one that is asked for, fitted first.

        First each law without a memory takes some steps, and LuGre's law if the errors of all are
        more than noise. Laws without a memory are searched further then. Those with a memory follow
        if the errors of the best one are more than noise, and friction without a law if theirs are,
        too. What predicts much worse in the search is not fitted further.
        """
        search, models = self._search, self._models
        self._limit.begin_stage(_SEARCH_TIME)
        tables = [search.table] if law == search.table.name else []
        plain = [*(competitor for competitor in laws if not competitor.memory), *tables]
        plain = search.by_regression(plain)
        self._begin(plain, progress)
        if law == AUTO and _may_have_memory(search.begun):
            progress(label_of(LUGRE))
            least = min(map(loss_of, search.begun))
            if _is_hopeless(least, search.first(LUGRE)):
                self._compete([LUGRE], progress)
        bristles = models[0] if models else None
        self._compete(plain, progress)
        several = len(search.rows.directions) > 1
        if several and models and _noise_of(chain(search.begun, models)) == inf:
            self._compete([DirectionalAdapter(min(models, key=loss_of).law)], progress)
        rivals = [rival for rival in laws if rival.memory and (bristles is None or rival != LUGRE)]
        if law == AUTO and bristles is None and not _may_have_memory(models):
            rivals = []
        for rival in rivals:
            if rival is DAHL or _noise_of(models) == inf:
                self._compete([rival], progress, bristles)
                bristles = models[-1] if models[-1].law is LUGRE else bristles
        if law == AUTO and _noise_of(models) == inf:
            self._compete([search.table], progress)
        return self._finished(models)

    def _begin(self, laws: Sequence[IdentifiedLaw], progress: Callable[[str], None]) -> None:
        """Take the first steps of laws, up to one whose errors are noise."""
        for law in laws:
            progress(label_of(law))
            if self._search.first(law).is_white:
                return
        if laws:
            self._search.extend_best()

    def _compete(
        self,
        laws: Sequence[IdentifiedLaw],
        progress: Callable[[str], None],
        like: Refinement | None = None,
    ) -> None:
        """Search laws one by one, near a LuGre model if there is one, then extend the fits."""
        search, models = self._search, self._models
        near: list[Sequence[Refinement]] = []
        for law in laws:
            self._limit.begin_part(_LAW_TIME if len(laws) > 1 else 1.0)
            if (models or near) and self._limit.is_over:
                self.left.append(label_of(law))
                continue
            progress(label_of(law))
            noise = _noise_of(chain(search.begun, models, *near))
            near.append(search.searched_near(law, like) if like else search.searched(law, noise))
        self._limit.begin_part(1.0)
        for fits in sorted(near, key=lambda fits: min(map(loss_of, fits))):
            least = min(map(loss_of, chain(models, *near)))
            models.append(search.extended(fits, least))

    def _finished(self, fits: Sequence[Refinement]) -> list[Refinement]:
        """Return searched models fitted further, the better ones first, as far as time allows."""
        best = min(fits, key=loss_of)
        near = [fit for fit in fits if not _is_hopeless(fit.loss, best)]
        finished = {fit: remarked(fit, _HOPELESS) for fit in fits}
        for number, fit in enumerate(sorted(near, key=loss_of)):
            self._limit.begin_stage(1.0 / (len(near) - number))
            finished[fit] = self._search.finished(fit)
            if finished[fit].remark == OUT_OF_TIME:
                self.left.append(label_of(fit.law))
        return [*finished.values()]


def _noise_of(fits: Iterable[Refinement]) -> float:
    """Return the least squared error of fits whose errors are noise; infinite if there is none."""
    return min((fit.loss for fit in fits if fit.is_white), default=inf)


def _may_have_memory(fits: Sequence[Refinement]) -> bool:
    """Return whether a memory may explain the errors: no noise, and no input that is missing."""
    shares = (rms(fit.residual) / fit.scale for fit in fits)
    return _noise_of(fits) == inf and min(shares) < _MISSING_INPUT_ERROR


def _is_hopeless(loss: float, best: Refinement) -> bool:
    """Return whether a squared error is too far behind a fit for its law to be fitted further."""
    return loss > _HOPELESS_LOSS_RATIO * best.loss
