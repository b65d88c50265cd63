"""Every number, formula and statement of the paper, and the computation that judges it."""

import tomllib
from importlib.resources import files

from stickslip_ros.paper.claims import (
    bifurcation_diagrams,
    coefficients,
    conclusions,
    control_effect,
    model,
    phase_portraits,
    stability,
    washout,
)
from stickslip_ros.paper.claims.claim import Chapter, Claim, Evidence, Finding, Undecidable, Verdict

COMPUTATIONS = (
    model.computes
    | stability.computes
    | coefficients.computes
    | bifurcation_diagrams.computes
    | phase_portraits.computes
    | washout.computes
    | control_effect.computes
    | conclusions.computes
)
"""The computation of each decidable claim, by its identifier."""


def _claim(
    identifier: str,
    place: str,
    statement: str,
    printed: float | str | None = None,
    undecidable: str | None = None,
) -> Claim:
    if undecidable is not None:
        return Claim(identifier, place, statement, printed, lambda _: Undecidable(undecidable))
    return Claim(identifier, place, statement, printed, COMPUTATIONS[identifier])


def _chapters() -> tuple[Chapter, ...]:
    text = files(__name__).joinpath("claims.toml").read_text(encoding="utf-8")
    return tuple(
        Chapter(title, tuple(_claim(identifier, **entry) for identifier, entry in entries.items()))
        for title, entries in tomllib.loads(text).items()
    )


CHAPTERS = _chapters()
"""The parts of the paper in order; the abstract is with the conclusions."""

CLAIMS = tuple(claim for chapter in CHAPTERS for claim in chapter.claims)
"""The claims of all chapters."""

__all__ = ["CHAPTERS", "CLAIMS", "Chapter", "Claim", "Evidence", "Finding", "Verdict"]
