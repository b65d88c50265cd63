"""Identification of drives on a spring: friction laws compete for the records."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from math import inf, sqrt

from stickslip_ros.identification.choice import AUTO
from stickslip_ros.identification.fit import OUT_OF_TIME
from stickslip_ros.identification.identified_law import IdentifiedLaw, label_of
from stickslip_ros.identification.law_search import (
    LawSearch,
    is_white,
    loss_of,
    remarked,
)
from stickslip_ros.identification.laws import DAHL, LUGRE, DirectionalAdapter
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.refinement import Refinement
from stickslip_ros.identification.time_limit import TimeLimit

POOR_ERROR = 0.1
"""Error, as a share of the motion, from which a model does not describe it."""
_MISSING_INPUT_ERROR = 0.5
"""Such an error, from which a memory is not tried: an input is missing."""
_HOPELESS_LOSS_RATIO = 4.0
"""A model whose squared error is larger than that of the best one by this factor is not fitted
further."""
_SEARCH_TIME = 0.7
"""Share of the time in which laws are searched; in the rest the best ones are fitted further."""
_LAW_TIME = 0.25
"""Share of what is left of it that the search of a law without a memory may take: others follow."""
_HOPELESS = "much worse in the search: not fitted further"


class DriveTask:
    """Records of a drive on a spring, for which laws compete."""

    def __init__(
        self, records: Sequence[Record], fixed: Mapping[str, float], limit: TimeLimit
    ) -> None:
        self._search, self._limit = LawSearch(records, fixed, limit), limit
        self.left: list[str] = []
        """Laws that were not fitted to the end, because the time was over."""

    def candidates(
        self, law: str, laws: Sequence[IdentifiedLaw], progress: Callable[[str], None]
    ) -> list[Refinement]:
        """Return the fits of the laws that compete, or of the one that is asked for, fitted first.

        First each law without a memory takes some steps, and LuGre's law if the errors of all are
        more than noise. Laws without a memory are searched further then. Those with a memory follow
        if the errors of the best one are more than noise, and friction without a law if theirs are,
        too. What predicts much worse in the search is not fitted further.
        """
        search = self._search
        models: list[Refinement] = []

        def compete(competitors: Sequence[IdentifiedLaw], like: Refinement | None = None) -> None:
            """Search laws one by one, then extend what was found of them."""
            near: list[Sequence[Refinement]] = []
            for competitor in competitors:
                self._limit.begin_part(_LAW_TIME if len(competitors) > 1 else 1.0)
                name = label_of(competitor)
                if (models or near) and self._limit.is_over:
                    self.left.append(name)
                    continue
                progress(name)
                if like is not None:
                    near.append(search.searched_near(competitor, like))
                    continue
                near.append(
                    search.searched(competitor, noise_of(chain(search.begun, models, *near)))
                )
            self._limit.begin_part(1.0)
            for fits in sorted(near, key=lambda fits: min(map(loss_of, fits))):
                least = min(map(loss_of, chain(models, *near)))
                models.append(search.extended(fits, least))

        def noise_of(fits: Iterable[Refinement]) -> float:
            return min(map(loss_of, filter(is_white, fits)), default=inf)

        def describe(fits: Sequence[Refinement]) -> bool:
            """Return whether a memory may explain the errors: it is no input that is missing."""
            return not fits or (law == AUTO and min(map(_share, fits)) < _MISSING_INPUT_ERROR)

        self._limit.begin_stage(_SEARCH_TIME)
        tables = [search.table] if law == search.table.name else []
        plain = [*(competitor for competitor in laws if not competitor.memory), *tables]
        plain = search.by_regression(plain)
        for competitor in plain:
            progress(label_of(competitor))
            if is_white(search.first(competitor)):
                break
        else:
            search.extend_best()
        bristles: Refinement | None = None
        if law == AUTO and describe(search.begun) and noise_of(search.begun) == inf:
            progress(label_of(LUGRE))
            least = min(map(loss_of, search.begun))
            if _HOPELESS_LOSS_RATIO * search.first(LUGRE).loss < least:
                compete([LUGRE])
                (bristles,) = models
        compete(plain)
        several = len(search.rows.directions) > 1
        if several and models and noise_of(chain(search.begun, models)) == inf:
            compete([DirectionalAdapter(min(models, key=loss_of).law)])
        searched = {model.law for model in models}
        rivals = [rival for rival in laws if rival.memory and rival not in searched]
        if not describe(models) or (bristles is None and noise_of(models) < inf):
            rivals = []
        for rival in rivals:
            if rival is DAHL or noise_of(models) == inf:
                compete([rival], bristles)
                bristles = models[-1] if models[-1].law is LUGRE else bristles
        if law == AUTO and noise_of(models) == inf:
            compete([search.table])
        return self._finished(models)

    def _finished(self, fits: Sequence[Refinement]) -> list[Refinement]:
        """Return searched models fitted further, the better ones first, as far as time allows."""
        least = min(map(loss_of, fits))
        near = [fit for fit in fits if fit.loss <= _HOPELESS_LOSS_RATIO * least]
        finished = {fit: remarked(fit, _HOPELESS) for fit in fits}
        for number, fit in enumerate(sorted(near, key=loss_of)):
            self._limit.begin_stage(1.0 / (len(near) - number))
            finished[fit] = self._search.finished(fit)
            if finished[fit].remark == OUT_OF_TIME:
                self.left.append(label_of(fit.law))
        return [*finished.values()]


def _share(fit: Refinement) -> float:
    """Return the rms error as a share of the rms motion."""
    return sqrt(fit.loss / len(fit.residual)) / fit.scale
